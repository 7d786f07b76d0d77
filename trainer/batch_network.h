#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

#include "trainer/kernels/network.h"
#include "trainer/workers.h"

namespace plumb {

/// A multilayer perceptron over a batch of samples (columns), several threads at work. The batch is cut into
/// groups whose number depends on its size alone, and sums over groups are taken in their order: the bits are
/// the same for any number of threads. Not thread-safe itself.
class BatchNetwork {
 public:
  /// @param sizes inputs, hidden..., outputs. @param workers must outlive this.
  BatchNetwork(std::vector<int> sizes, Workers& workers);

  int parameter_count() const { return network_.parameter_count(); }
  /// @param parameters at least parameter_count(); what follows (a policy's log_std) is ignored.
  void Set(const Eigen::Ref<const Eigen::VectorXf>& parameters);

  /// Evaluates the network.
  /// @param inputs inputs x columns; read again by GaussNewtonProduct. @param outputs outputs x columns,
  /// written.
  void Forward(const float* inputs, int columns, float* outputs);

  /// For the samples [first, first + count): fills output_gradient (outputs x count) from outputs (same
  /// shape).
  using Loss = std::function<void(int first, int count, const float* outputs, float* output_gradient)>;
  /// The gradient of a loss in the parameters. `loss` is called concurrently, for groups that do not overlap.
  /// @param gradient parameter_count() values, written.
  void Gradient(const float* inputs, int columns, const Loss& loss, Eigen::Ref<Eigen::VectorXf> gradient);

  /// sum over the samples of the last Forward of J' M J v, with J the Jacobian of the outputs in the
  /// parameters and M the diagonal `metric` (outputs values).
  /// @param direction v and @param product both of parameter_count() values.
  void GaussNewtonProduct(const Eigen::Ref<const Eigen::VectorXf>& direction,
                          const Eigen::Ref<const Eigen::VectorXf>& metric,
                          Eigen::Ref<Eigen::VectorXf> product);

 private:
  struct Group {
    int first, count;
    kernels::Tape tape;
    std::vector<float> outputs, output_gradient;  // outputs x count, work space
    Eigen::VectorXf gradient;
  };

  void Divide(int columns);
  void SumGroups(Eigen::Ref<Eigen::VectorXf> gradient) const;

  std::vector<int> sizes_;
  Workers* workers_;
  kernels::Network network_, direction_;
  std::vector<Group> groups_;
  int active_groups_ = 0;  // the others are spare, from larger batches
};

}  // namespace plumb
