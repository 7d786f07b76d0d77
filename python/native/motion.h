#pragma once

#include <memory>

#include "calibrator/motion/log.h"
#include "python/native/module.h"

namespace plumb::python {

/// A robot's recorded motion, and the robot. Immutable, hence thread-safe.
struct Motion {
  std::shared_ptr<const Robot> robot;
  Log log;
};

}  // namespace plumb::python
