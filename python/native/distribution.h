#pragma once

#include <memory>

#include "python/native/module.h"
#include "robot/parameter_distribution.h"

namespace plumb::python {

/// Which simulators a robot may be, and the robot. Immutable, hence thread-safe.
struct Distribution {
  std::shared_ptr<const Robot> robot;
  ParameterDistribution of;
};

/// @throws pybind11::value_error naming the argument if the distribution is of other parameters or
/// other physics than the robot's.
void RequireSameRobot(const char* name, const Distribution& distribution, const Robot& robot);

}  // namespace plumb::python
