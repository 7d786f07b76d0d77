#pragma once

#include "sim/dynamics/narrow_phase.h"

namespace plumb {

/// Where two boxes are near each other, by the axis along which they are farthest apart or overlap
/// least: of a face, the corners of the other's face clipped by it; of two edges, the spot between
/// them (Ericson, "Real-Time Collision Detection", 2005, section 4.4; clipping after Sutherland and
/// Hodgman, 1974). @param margin [m] beyond which a spot is none. @return how many. Never throws
/// nor allocates. Thread-safe.
int NearBoxes(const PlacedSolid& first, const PlacedSolid& second, double margin, NearSpots* spots);

}  // namespace plumb
