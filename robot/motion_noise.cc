#include "robot/motion_noise.h"

#include <algorithm>
#include <cmath>

#include "robot/imu_mounting.h"

namespace plumb {
namespace {

void Override(EstimatorSettings& s, const NoiseDescription& noise) {
  const auto set = [](double& value, double said) {
    if (!std::isnan(said)) value = said;
  };
  set(s.position_sd, noise.position_sd);
  set(s.velocity_sd, noise.velocity_sd);
  set(s.jerk, noise.jerk);
  set(s.effort_step, noise.effort_step);
  set(s.ground_impact, noise.ground_impact);
  set(s.stop_impact, noise.stop_impact);
  set(s.coupling, noise.coupling);
  set(s.delay, noise.delay);
}

}  // namespace

EstimatorSettings EstimatorOf(const RobotDescription& robot, int joint) {
  EstimatorSettings s = robot.estimator;
  for (const SensorDescription& sensor : robot.sensors) {
    if (sensor.link < 0) {
      if (sensor.joint == joint) Override(s, sensor.noise);
      continue;
    }
    const ImuMounting mounting = MountingOf(robot, sensor.link);
    if (mounting.turned == joint) {
      Override(s, sensor.noise);
      s.bias_sd = sensor.rate_bias_sd;
    }
    const auto slides = [&](const ImuMounting::Slide& slide) { return slide.joint == joint; };
    if (std::any_of(mounting.slides.begin(), mounting.slides.end(), slides)) {
      s.acceleration_sd = sensor.acceleration_sd;
      s.bias_sd = sensor.acceleration_bias_sd;
    }
  }
  Override(s, robot.joints[static_cast<size_t>(joint)].noise);
  // none of the efforts is its own
  if (robot.joints[static_cast<size_t>(joint)].passive) s.coupling = 1;
  return s;
}

}  // namespace plumb
