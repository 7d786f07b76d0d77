#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace plumb {

/// All that any number of linear errors r + J (u - at) say about u: the sum of squares of each
/// group is a quadratic function of u, kept as the (1 + n) x (1 + n) matrix sum (r, J)'(r, J) at a
/// common reference. Errors can be taken away again. Memory: 8 (1 + n)^2 bytes a group. Not
/// thread-safe.
class GroupSums {
 public:
  /// The posterior of the errors so far, with a standard normal prior.
  struct Fit {
    Eigen::VectorXd mode;         ///< n
    Eigen::MatrixXd information;  ///< of the errors alone, J'J / s^2
    Eigen::VectorXd scale;        ///< s of each group's noise, see NoiseScale
  };

  /// @param reference n. Best near the mode: far from it the sums are differences of large numbers.
  GroupSums(int groups, const Eigen::VectorXd& reference);

  /// @param group of each row. @param errors rows x (1 + n): (r, J). @param at n, where errors are
  /// r.
  void Add(std::span<const int> group, const Eigen::MatrixXd& errors, const Eigen::VectorXd& at) {
    Add(group, errors, at, 1);
  }
  void TakeAway(std::span<const int> group, const Eigen::MatrixXd& errors,
                const Eigen::VectorXd& at) {
    Add(group, errors, at, -1);
  }

  /// How many errors there are, of each group.
  const Eigen::VectorXd& rows() const { return rows_; }

  /// The point where the slope of |r(u)/s|^2 / 2 + |u|^2 / 2 vanishes for the noise scales s
  /// estimated there: what FitLaplace finds for linear errors with neither heavy tails nor
  /// clusters. A fixed-point iteration, O(groups n^2 + n^3) each time.
  Fit Solve(bool scale_known) const;

 private:
  void Add(std::span<const int> group, const Eigen::MatrixXd& errors, const Eigen::VectorXd& at,
           double sign);

  Eigen::VectorXd reference_;
  std::vector<Eigen::MatrixXd> sums_;
  Eigen::VectorXd rows_;
};

}  // namespace plumb
