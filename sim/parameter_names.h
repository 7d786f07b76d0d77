#pragma once

#include <cstddef>
#include <iterator>

#include "sim/dynamics/physics.h"

// What the numbers of a robot's physics are called in the paths of parameters: see parameters.h.
namespace plumb {

/// Numbers of Physics::Axis and Physics::Globals in their order.
inline constexpr const char* kAxisNames[] = {
    "armature", "damping",       "friction", "stiffness",    "rest",
    "gain",     "no_load_speed", "delay",    "sensor_delay", "sensor_bias"};
inline constexpr size_t kSlowing = 6;
inline constexpr const char* kGlobalNames[] = {"gravity",         "contact/stiffness",
                                               "contact/damping", "contact/friction",
                                               "limit/stiffness", "limit/damping"};
static_assert(sizeof(Physics<double>::Axis) == std::size(kAxisNames) * sizeof(double));
static_assert(sizeof(Physics<double>::Globals) == std::size(kGlobalNames) * sizeof(double));

/// xx, yy, zz, xy, xz, yz of a matrix.
inline constexpr struct {
  const char* name;
  int row, column;
} kEntries[] = {{"xx", 0, 0}, {"yy", 1, 1}, {"zz", 2, 2}, {"xy", 1, 0}, {"xz", 2, 0}, {"yz", 2, 1}};

}  // namespace plumb
