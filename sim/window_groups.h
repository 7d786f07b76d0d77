#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "sim/effort_track.h"
#include "sim/model.h"
#include "sim/windows.h"

namespace plumb {

/// As many windows as an engine has lanes, all with the same numbers of substeps: they are
/// simulated side by side. The last group of a kind may repeat one. A value.
struct WindowGroup {
  std::vector<size_t> windows;
  std::vector<int> counts;  ///< substeps of each step
  size_t used = 0;          ///< lanes with a window of their own
};

/// Every window is in one group; they are in the order of their numbers of substeps. Thread-safe.
/// @throws std::invalid_argument if a window is not as it should be, or too long.
std::vector<WindowGroup> GroupWindows(std::span<const Window> windows, const Model& model,
                                      size_t lanes);

/// [s] of a control step. Thread-safe.
double Duration(std::span<const EffortSegment> step);

}  // namespace plumb
