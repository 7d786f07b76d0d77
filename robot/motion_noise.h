#pragma once

#include "robot/description.h"

namespace plumb {

/// What the estimator assumes of a joint: [estimator], where the sensor that measures the joint
/// does not know better, where [joint.estimator] does not say otherwise. An IMU adds its bias and,
/// to joints that slide under it, the noise of its accelerometer. @param joint index into
/// robot.joints
EstimatorSettings EstimatorOf(const RobotDescription& robot, int joint);

}  // namespace plumb
