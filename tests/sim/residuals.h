#pragma once

#include <memory>

#include "robot/residual.h"
#include "sim/residual_inputs.h"

namespace plumb {

/// The same change of velocities, or of positions and velocities, in every step of a condition.
inline ResidualFunction Constant(const RobotDescription& robot, const Eigen::VectorXd& change) {
  const Eigen::Index d = ResidualInputCount(robot), n = 2 * robot.num_velocities();
  ResidualFunction f;
  f.mean = Eigen::VectorXd::Zero(d), f.scale = Eigen::VectorXd::Ones(d);
  f.low = Eigen::VectorXd::Constant(d, -1), f.high = Eigen::VectorXd::Constant(d, 1);
  f.centres = Eigen::MatrixXd::Ones(3, d);
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(n, f.features());
  weights.col(0).tail(change.size()) = change;
  f.weights = {weights};
  f.noise = Eigen::MatrixXd::Zero(n, n);
  f.bound = Eigen::VectorXd::Constant(n, 10);
  f.unknown = Eigen::VectorXd::Zero(n);
  return f;
}

/// One that has no function yet.
inline std::shared_ptr<Residual> Of(const RobotDescription& robot) {
  auto residual = std::make_shared<Residual>();
  residual->coordinates = {
      Eigen::VectorXd::Zero(static_cast<Eigen::Index>(robot.parameters.size()))};
  return residual;
}

}  // namespace plumb
