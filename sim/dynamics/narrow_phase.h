#pragma once

#include <array>
#include <cstddef>

#include "sim/dynamics/vector.h"

namespace plumb {

/// A convex solid in its place: all that is within `radius` of a box, which has no size for a
/// sphere and one dimension for a capsule. Plain data, not thread-safe.
struct PlacedSolid {
  Vector<double> centre{};               ///< [m]
  std::array<Vector<double>, 3> axes{};  ///< unit vectors along the box's edges
  std::array<double, 3> half{};  ///< [m] half its edges; a capsule's is along the third axis
  double radius = 0;             ///< [m] >= 0; of a box zero
  bool is_box() const { return half[0] > 0; }
};

/// Where two solids are near each other.
struct NearSpot {
  Vector<double> position{};  ///< [m] half-way between the two surfaces
  Vector<double> normal{};    ///< unit vector from the first solid towards the second
  double distance = 0;        ///< [m] between the surfaces; negative where they overlap
};

inline constexpr int kMostSpots = 8;  ///< of two boxes
using NearSpots = std::array<NearSpot, kMostSpots>;

/// How many spots two solids have at most: 1 of a sphere and anything, 2 of a capsule that lies on
/// another or on a box, 8 of boxes. @param first, second half their edges, as PlacedSolid has them.
/// Thread-safe.
__attribute__((visibility("default"))) size_t MostSpots(const double* first, const double* second);

/// Finds where two solids are nearer than `margin` [m]: closest points of segments (Ericson,
/// "Real-Time Collision Detection", 2005, section 5.1.9), of a segment and a box by its convex
/// distance along the segment, and of boxes by separating axes and a face clipped by another (the
/// same, sections 4.4 and 8.3). Distances of solids that do not touch are exact but for boxes',
/// which are lower bounds. @return how many. Never throws nor allocates. Thread-safe.
__attribute__((visibility("default"))) int FindNearSpots(const PlacedSolid& first,
                                                         const PlacedSolid& second, double margin,
                                                         NearSpots* spots);

}  // namespace plumb
