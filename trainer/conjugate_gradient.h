#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>

namespace plumb {

/// The result of ConjugateGradient.
struct LinearSolution {
  Eigen::VectorXd x;
  Eigen::VectorXd residual;  ///< b - A x, as the recursion has it
  int iterations = 0;
  std::string failure;  ///< why there is no solution; empty = x is good
};

/// Solves A x = b for symmetric positive definite A by conjugate gradients (Hestenes and Stiefel,
/// 1952), starting from x = 0. Gives up, saying so, at the first direction whose curvature is not
/// positive or not finite.
/// Thread-safe if `product` is.
/// @param product writes A v to its second argument, of b's size. @param iterations at most.
/// @param tolerance stops when |residual|^2 <= tolerance * |b|^2.
LinearSolution ConjugateGradient(
    const std::function<void(const Eigen::VectorXd& v, Eigen::VectorXd& av)>& product,
    const Eigen::VectorXd& b, int iterations, double tolerance);

}  // namespace plumb
