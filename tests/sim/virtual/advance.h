#pragma once

#include <Eigen/Core>
#include <algorithm>

#include "sim/virtual/physics_backend.h"

namespace plumb {

/// By steps that have nothing in common with any period, or shorter ones.
inline bool Advance(PhysicsBackend& engine, const Eigen::VectorXd& effort, double duration,
                    double step = 0.0037) {
  for (double t = 0; t < duration; t += step) {
    if (!engine.Advance(effort, std::min(step, duration - t))) return false;
  }
  return true;
}

}  // namespace plumb
