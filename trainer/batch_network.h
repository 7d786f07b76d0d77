#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "common/ranks.h"
#include "trainer/kernels/network.h"
#include "trainer/workers.h"

namespace plumb {

/// A multilayer perceptron over a batch of samples (columns), several threads and ranks at work.
/// The batch is cut into groups whose number depends on its size alone, and sums over groups are
/// taken in a fixed order: the bits are the same for any number of threads and ranks. All ranks
/// call the same methods with the same arguments and get the same results. Not thread-safe itself.
class BatchNetwork {
 public:
  /// @param sizes inputs, hidden..., outputs. @param workers,ranks must outlive this.
  BatchNetwork(std::vector<int> sizes, Workers& workers, const Ranks& ranks = Ranks::Alone());

  int parameter_count() const { return network_.parameter_count(); }
  /// @param parameters at least parameter_count(); what follows (a policy's log_std) is ignored.
  void Set(const Eigen::Ref<const Eigen::VectorXf>& parameters);

  /// Evaluates the network.
  /// @param inputs inputs x columns. @param outputs outputs x columns, written.
  void Forward(const float* inputs, int columns, float* outputs);

  /// Adds what is asked of the samples [first, first + count) to sums. Called concurrently, for
  /// groups that do not overlap; not on every rank for each.
  /// @param outputs outputs x count.
  using Summand =
      std::function<void(int first, int count, const float* outputs, std::span<double> sums)>;
  /// Evaluates the network. @param sums over the samples, written.
  void Sum(const float* inputs, int columns, const Summand& summand, std::span<double> sums);

  /// As Summand; also fills output_gradient (outputs x count).
  using Loss = std::function<void(int first, int count, const float* outputs,
                                  float* output_gradient, std::span<double> sums)>;
  /// The gradient of a loss in the parameters.
  /// @param gradient parameter_count() values, written. @param sums as of Sum.
  void Gradient(const float* inputs, int columns, const Loss& loss,
                const Eigen::Ref<Eigen::VectorXf>& gradient, std::span<double> sums = {});

  /// Evaluates the network, for GaussNewtonProduct.
  /// @param inputs inputs x columns; read again by GaussNewtonProduct.
  void Linearize(const float* inputs, int columns);
  /// sum over the samples of the last Linearize of J' M J v, with J the Jacobian of the outputs in
  /// the parameters and M the diagonal `metric` (outputs values).
  /// @param direction v and @param product both of parameter_count() values.
  void GaussNewtonProduct(const Eigen::Ref<const Eigen::VectorXf>& direction,
                          const Eigen::Ref<const Eigen::VectorXf>& metric,
                          const Eigen::Ref<Eigen::VectorXf>& product);

 private:
  struct Group {
    int first, count;
    kernels::Tape tape;
    std::vector<float> outputs, output_gradient;  // outputs x count, work space
    Eigen::VectorXf gradient;
  };

  void Divide(int columns);
  /// Evaluates the network for this rank's groups, and does the work on each; `number` counts all
  /// ranks' groups.
  void ForGroups(const float* inputs, const std::function<void(Group& group, int number)>& work);
  void SumGradients(Eigen::Ref<Eigen::VectorXf> sum);
  /// @param summands sums x groups; this rank's columns are filled.
  void SumOverGroups(Eigen::MatrixXd& summands, std::span<double> sums) const;
  /// The first sample of a group.
  int First(int group) const { return static_cast<int>(int64_t{columns_} * group / all_groups_); }

  std::vector<int> sizes_;
  Workers* workers_;
  const Ranks* ranks_;
  kernels::Network network_, direction_;
  std::vector<Group> groups_;  // this rank's, and spare ones from larger batches
  // Of the present batch:
  int columns_ = 0;
  bool shared_ = false;                   // among ranks; if not, each does all of it
  int all_groups_ = 0;                    // of all ranks
  int first_group_ = 0, own_groups_ = 0;  // of this rank
};

}  // namespace plumb
