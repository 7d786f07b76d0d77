#include "trainer/conjugate_gradient.h"

#include <fmt/format.h>

#include <cmath>

namespace plumb {

LinearSolution ConjugateGradient(
    const std::function<void(const Eigen::VectorXd&, Eigen::VectorXd&)>& product,
    const Eigen::VectorXd& b, int iterations, double tolerance) {
  LinearSolution solution{Eigen::VectorXd::Zero(b.size()), b, 0, {}};
  Eigen::VectorXd direction = b, image(b.size());
  double square = b.squaredNorm();
  const double enough = tolerance * square;
  if (!std::isfinite(square)) solution.failure = "right-hand side is not finite";
  while (solution.failure.empty() && solution.iterations < iterations && square > enough) {
    product(direction, image);
    const double curvature = direction.dot(image);
    if (!std::isfinite(curvature) || curvature <= 0) {
      solution.failure =
          fmt::format("curvature {} after {} iterations", curvature, solution.iterations);
      break;
    }
    const double step = square / curvature;
    solution.x += step * direction;
    solution.residual -= step * image;
    const double next_square = solution.residual.squaredNorm();
    direction = solution.residual + (next_square / square) * direction;
    square = next_square;
    ++solution.iterations;
  }
  return solution;
}

}  // namespace plumb
