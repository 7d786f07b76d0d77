#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

namespace plumb {

/// How large the noise of groups of errors is, from the sums of their squares. Groups of fewer than
/// 20 rows share one scale. Immutable.
class NoiseScale {
 public:
  static constexpr double kLeast = 1e-9;  ///< smaller errors are a simulation's rounding

  /// @param rows of each group, >= 0. @param known errors are whitened already, see LeastSquares.
  NoiseScale(const Eigen::VectorXd& rows, bool known);

  /// The group that stands for those that share the scale of group g.
  int shared(int g) const { return shared_[static_cast<size_t>(g)]; }
  /// The scale s of each group, s^2 = sum r^2 / (N - effective N / N_all); where it is known, it
  /// counts as 20 errors of variance one, and is one at least. 1 for groups that nothing was
  /// observed of. @param squares sum of r^2, in the entries that stand for others: of all that
  /// share it. @param effective number of parameters that the errors were fitted with. @param
  /// surplus by which robust weights exceed one on average; counts only where the scale is not
  /// known.
  Eigen::VectorXd Estimate(const Eigen::VectorXd& squares, double effective,
                           double surplus = 1) const;

 private:
  bool known_;
  double all_rows_;
  std::vector<int> shared_;
  Eigen::VectorXd rows_;  // of each group, those that share its scale included
};

/// The distribution of errors around zero: each row of a group has the same scale, and each block
/// of k rows is normal or Student's t in k dimensions. See FitLaplace. Not thread-safe.
class Noise {
 public:
  static constexpr double kLeastScale = NoiseScale::kLeast;

  /// @param group, block of each row, see LeastSquares.
  Noise(const std::vector<int>& group, const std::vector<int>& block, bool scale_known,
        double degrees_of_freedom = std::numeric_limits<double>::infinity());

  /// Scales that maximise the likelihood, or nearly so. @param effective number of parameters that
  /// the errors were fitted with.
  void Estimate(const Eigen::VectorXd& errors, double effective);
  /// Chooses the degrees of freedom by likelihood. @return true if they have changed.
  bool ChooseTails(const Eigen::VectorXd& errors, double effective);

  /// Sum over blocks of ln p, the constant that depends on neither scale nor tails left out.
  double LogLikelihood(const Eigen::VectorXd& errors) const;
  /// Of each row in a weighted least-squares step: robust weight / scale^2.
  Eigen::VectorXd Weights(const Eigen::VectorXd& errors) const;
  /// Expected Fisher information of parameters with this Jacobian: J' J / s^2, times (f + k) / (f +
  /// k + 2) for Student's t.
  Eigen::MatrixXd Information(const Eigen::MatrixXd& jacobian) const;

  const Eigen::VectorXd& scale() const { return scale_; }  ///< of each group
  Eigen::VectorXd RowScale() const;                        ///< of each row
  double degrees_of_freedom() const { return degrees_of_freedom_; }

 private:
  Eigen::VectorXd BlockSquares(const Eigen::VectorXd& errors) const;
  Eigen::ArrayXd BlockWeights(const Eigen::VectorXd& errors) const;  // (f + k) / (f + |r / s|^2)
  Eigen::VectorXd OfRows(const Eigen::ArrayXd& of_block) const;

  const std::vector<int>& group_;
  const std::vector<int>& block_;
  bool scale_known_;
  int groups_ = 0;
  NoiseScale rule_;
  Eigen::VectorXd block_size_;
  Eigen::VectorXd scale_;
  double degrees_of_freedom_;
};

}  // namespace plumb
