#include "calibrator/fit/robot_least_squares.h"

#include <cmath>
#include <utility>
#include <vector>

#include "calibrator/fit/physical_columns.h"

namespace plumb {
namespace {

constexpr int kClusterSteps = 25;  // beyond the memory of an estimator's smoother

}  // namespace

Prior PriorOf(const RobotDescription& robot) {
  std::vector<Prior::Marginal> marginals;
  for (const ParameterDescription& p : robot.parameters) {
    marginals.push_back(Prior::Normal(p.coordinate_mean(), std::sqrt(p.coordinate_variance())));
  }
  return Prior(std::move(marginals));
}

LeastSquares ProblemOf(const RobotDescription& robot, WindowErrors& errors) {
  LeastSquares problem{PriorOf(robot),
                       [&](const Eigen::MatrixXd& coordinates) {
                         return errors.Whitened(PhysicalColumns(robot, coordinates));
                       },
                       {},
                       {},
                       {},
                       errors.noise_known()};
  int block = -1, cluster = -1, steps = kClusterSteps;
  const WindowErrors::Row* before = nullptr;
  for (const WindowErrors::Row& row : errors.rows()) {
    const bool new_step =
        !before || row.window != before->window || row.transition != before->transition;
    const bool new_window = !before || row.window != before->window;
    if (new_step) ++block, ++steps;
    if (!before || (new_window && (steps > kClusterSteps || row.rollout != before->rollout)))
      ++cluster, steps = 1;
    problem.group.push_back(row.coordinate);
    problem.block.push_back(block);
    problem.cluster.push_back(cluster);
    before = &row;
  }
  return problem;
}

}  // namespace plumb
