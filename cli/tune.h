#pragma once

#include <string>

namespace plumb {

/// `plumb estimate tune`: learns from an LCM log's JOINT_STATE and IMU what noise the sensors and
/// the motion have, and prints the lines of [joint.estimator] that say so, joint by joint.
/// Thread-safe. @return exit status 0. @throws std::runtime_error or std::invalid_argument if the
/// log cannot be read or is too short.
int TuneEstimator(const std::string& robot, const std::string& log);

}  // namespace plumb
