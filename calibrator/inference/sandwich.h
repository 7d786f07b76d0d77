#pragma once

#include <Eigen/Core>
#include <vector>

namespace plumb {

// The functions here share nothing: thread-safe.

struct Sandwich {
  /// n x n: what the data tell when their dependence is taken into account
  Eigen::MatrixXd information;
  double inflation = 1;  ///< largest factor by which a variance has grown, >= 1
};

/// Takes information away in the directions in which the scores of clusters scatter more than they
/// would if all errors were independent: S = sum_c g_c g_c' against H (see FitLaplace). A direction
/// counts if its ratio exceeds what chance gives the largest of n with so many clusters: the edge
/// (1 + sqrt(n / C))^2 of Marchenko and Pastur's law, and 3 sqrt(2 / C) more. Fewer than 4 n
/// clusters tell nothing of their scatter, and change nothing.
/// @param information H, n x n. @param scores rows x n: weighted error times Jacobian. @param
/// cluster of each row, ascending.
Sandwich WidenBySandwich(const Eigen::MatrixXd& information, const Eigen::MatrixXd& scores,
                         const std::vector<int>& cluster);

}  // namespace plumb
