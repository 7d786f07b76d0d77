#pragma once

#include <memory>

#include "controller/policy.h"
#include "python/native/module.h"

namespace plumb::python {

/// A policy of a robot's task. Immutable, hence thread-safe.
struct Policy {
  std::shared_ptr<const Robot> robot;
  GaussianPolicy gaussian;
};

}  // namespace plumb::python
