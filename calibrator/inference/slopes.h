#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>

namespace plumb {

/// Of slopes by differences, in standard coordinates: far above the simulations' rounding, far
/// below any prior's width.
inline constexpr double kSlopeDifference = 1e-5;

/// Share of a column's sum of squares above which one observation's is doubted.
inline constexpr double kDominant = 0.5;

/// Slopes of errors by forward differences, rows x n; backward where forward is no simulator, zero
/// where neither is one.
///
/// Errors may jump: a contact is made or not, a foot sticks or slips. A difference across a jump is
/// no slope, but so large that it would pass for nearly all that is known of a parameter. So where
/// one observation (one transition, say) has more than kDominant of a column, the other side is
/// asked, too; if it says something else, each row of the column is the flatter side's, and zero
/// where the sides are opposite. Other columns keep their bits. Thread-safe if `errors` is.
/// @param errors n x N points -> rows x N; a column that is not finite is a failed simulation. All
/// points of one kind are asked for at once. @param at_u errors(u).
/// @param block of each row, ascending from 0: rows of one observation.
Eigen::MatrixXd Slopes(const std::function<Eigen::MatrixXd(const Eigen::MatrixXd&)>& errors,
                       const Eigen::VectorXd& u, const Eigen::VectorXd& at_u,
                       std::span<const int> block);

/// The same, central: the mean of both sides, which errs by the square of the difference only. A
/// column whose sides disagree by what one observation says is the flatter side's, as above.
/// @param forward Slopes.
Eigen::MatrixXd CentralSlopes(const std::function<Eigen::MatrixXd(const Eigen::MatrixXd&)>& errors,
                              const Eigen::VectorXd& u, const Eigen::VectorXd& at_u,
                              std::span<const int> block, const Eigen::MatrixXd& forward);

}  // namespace plumb
