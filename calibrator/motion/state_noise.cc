#include "calibrator/motion/state_noise.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "robot/motion_noise.h"

namespace plumb {
namespace {

constexpr int kPeriods = 30;  // of control, until the filter has settled
constexpr double kUnknown = 1e6, kUnmeasured = 1e3;

// (sd of q, sd of v) where the acceleration steps by an unknown amount of this sd once per control
// step.
Eigen::Vector2d Smoothed(const EstimatorSettings& settings, double dt, int per_control_step,
                         double acceleration_step) {
  Eigen::Matrix3d transition, process;
  transition << 1, dt, dt * dt / 2, 0, 1, dt, 0, 0, 1;
  const double s = settings.jerk * settings.jerk;
  process << std::pow(dt, 5) / 20, std::pow(dt, 4) / 8, std::pow(dt, 3) / 6,  //
      std::pow(dt, 4) / 8, std::pow(dt, 3) / 3, dt * dt / 2,                  //
      std::pow(dt, 3) / 6, dt * dt / 2, dt;
  process *= s;
  const Eigen::Vector2d measurement(std::pow(settings.position_sd, 2),
                                    std::pow(settings.velocity_sd, 2));
  std::vector<Eigen::Matrix3d> filtered, predicted;
  Eigen::Matrix3d covariance =
      Eigen::Vector3d(measurement(0), measurement(1), kUnknown).asDiagonal();
  // As many steps of control after the middle as the lag allows to look ahead.
  const int at = kPeriods * per_control_step, last = at + settings.lag;
  for (int k = 0; k <= last; ++k) {
    predicted.push_back(covariance);
    const Eigen::Matrix2d innovation =
        covariance.topLeftCorner<2, 2>() + Eigen::Matrix2d(measurement.asDiagonal());
    const Eigen::Matrix<double, 3, 2> gain = covariance.leftCols<2>() * innovation.inverse();
    covariance -= gain * covariance.topRows<2>();
    if (k % per_control_step == 0) covariance(2, 2) += acceleration_step * acceleration_step;
    filtered.push_back(covariance);
    covariance = transition * covariance * transition.transpose() + process;
  }
  Eigen::Matrix3d smoothed = filtered.back();
  for (int k = last - 1; k >= at; --k) {
    const Eigen::Matrix3d& ahead = predicted[static_cast<size_t>(k) + 1];
    const Eigen::Matrix3d gain =
        filtered[static_cast<size_t>(k)] * transition.transpose() * ahead.inverse();
    smoothed = filtered[static_cast<size_t>(k)] + gain * (smoothed - ahead) * gain.transpose();
  }
  return smoothed.diagonal().head<2>().cwiseSqrt();
}

// An encoder on a joint without a motor tells no velocity.
bool MeasuresVelocity(const RobotDescription& robot, int joint) {
  const auto encoder = [&](const SensorDescription& sensor) {
    return sensor.link < 0 && sensor.joint == joint;
  };
  return !robot.joints[static_cast<size_t>(joint)].passive ||
         std::ranges::none_of(robot.sensors, encoder);
}

}  // namespace

Eigen::VectorXd SmoothedNoise(const RobotDescription& robot) {
  const Eigen::Index n = robot.num_velocities();
  const double dt = std::min(robot.driver.measurement, robot.task.period);
  const int per_control_step = std::max(1, static_cast<int>(std::lround(robot.task.period / dt)));
  Eigen::VectorXd sd(2 * n);
  Eigen::Index velocity = 0;
  // A step of any joint's effort may step every joint's acceleration.
  double max_effort = 0;
  for (const JointDescription& joint : robot.joints) {
    if (!joint.passive) max_effort = std::hypot(max_effort, joint.effort_limit);
  }
  const auto felt = [&](const JointDescription& joint, double coupling) {
    const double own = joint.passive ? 0 : joint.effort_limit;
    return std::hypot(coupling * max_effort, std::sqrt(1 - coupling * coupling) * own);
  };
  for (int j = 0; j < robot.num_joints(); ++j) {
    EstimatorSettings settings = EstimatorOf(robot, j);
    if (!MeasuresVelocity(robot, j)) settings.velocity_sd = kUnmeasured;
    const Eigen::Vector2d noise = Smoothed(
        settings, dt, per_control_step,
        settings.effort_step * felt(robot.joints[static_cast<size_t>(j)], settings.coupling));
    for (int i = 0; i < robot.joints[static_cast<size_t>(j)].num_velocities(); ++i, ++velocity) {
      sd(velocity) = noise(0);
      sd(n + velocity) = noise(1);
    }
  }
  return sd;
}

}  // namespace plumb
