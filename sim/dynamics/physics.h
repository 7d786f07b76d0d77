#pragma once

#include <array>
#include <cstddef>
#include <iterator>
#include <vector>

#include "robot/parameter_kinds.h"
#include "sim/dynamics/real.h"

namespace plumb {

/// The terms of the equations that a robot has: those that are false cost nothing. Plain data.
struct Terms {
  bool stops = false;
  /// By kJointParameterKinds: some joint has the number other than by default, or may have it.
  std::array<bool, std::size(kJointParameterKinds)> joints = {};

  bool Has(double JointDynamics::*member) const {
    for (size_t i = 0; i < joints.size(); ++i) {
      if (kJointParameterKinds[i].member == member) return joints[i];
    }
    return false;
  }
};

/// The numbers of a robot that may differ from one simulator to the next. All vectors are in
/// working axes: those that every link's axes are parallel to where q = 0 (see Topology), hence
/// constant in the link. Real is double, or a pack with one robot per lane. Not thread-safe.
template <class Real>
struct Physics {
  struct Link {
    Real mass;        ///< [kg]
    Real center[3];   ///< [m] of mass, from the link's origin
    Real inertia[6];  ///< [kg m^2] about the centre of mass: xx, yy, zz, xy, xz, yz
    Real origin[3];   ///< [m] of the link's joint, from its parent's origin
  };
  struct Point {       ///< a sphere that may touch the ground
    Real position[3];  ///< [m] from its link's origin
    Real radius;       ///< [m]
  };
  struct Solid {       ///< a shape that may touch others: see PlacedSolid
    Real position[3];  ///< [m] of its centre, from its link's origin
    Real half[3];      ///< [m] along its own axes
    Real radius;       ///< [m]
  };

  std::vector<Link> links;                  ///< one per joint: the link that it moves
  std::vector<JointDynamicsOf<Real>> axes;  ///< one per velocity: its joint's
  std::vector<Point> points;
  std::vector<Solid> solids;
  WorldOf<Real> world;
};

namespace internal {
template <class Real, class Wide, class Narrow>
void SetLane(Wide* wide, const Narrow* narrow, size_t count, int lane) {
  constexpr size_t kLaneCount = kLanes<Real>;
  static_assert(sizeof(Wide) == kLaneCount * sizeof(Narrow));
  auto* to = reinterpret_cast<double*>(wide) + lane;
  const auto* from = reinterpret_cast<const double*>(narrow);
  for (size_t i = 0; i < count * (sizeof(Narrow) / sizeof(double)); ++i)
    to[i * kLaneCount] = from[i];
}
}  // namespace internal

/// Makes one lane of `wide` the robot `narrow`. @param lane in [0, kLanes<Real>). Sizes must agree.
template <class Real>
void SetLane(const Physics<double>& narrow, int lane, Physics<Real>* wide) {
  internal::SetLane<Real>(wide->links.data(), narrow.links.data(), narrow.links.size(), lane);
  internal::SetLane<Real>(wide->axes.data(), narrow.axes.data(), narrow.axes.size(), lane);
  internal::SetLane<Real>(wide->points.data(), narrow.points.data(), narrow.points.size(), lane);
  internal::SetLane<Real>(wide->solids.data(), narrow.solids.data(), narrow.solids.size(), lane);
  internal::SetLane<Real>(&wide->world, &narrow.world, 1, lane);
}

}  // namespace plumb
