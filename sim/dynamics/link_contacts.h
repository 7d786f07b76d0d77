#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "sim/dynamics/narrow_phase.h"
#include "sim/dynamics/physics.h"
#include "sim/dynamics/spatial_tree.h"
#include "sim/dynamics/topology.h"

namespace plumb {

/// Where a robot's links touch each other, as many spots as each pair may have, in lanes: found one
/// lane after the other, so that each has the bits it would have alone. Work space of one Stepper;
/// not thread-safe. The topology must outlive it.
template <class Real>
class LinkContacts {
 public:
  /// [m] Spots that are farther apart are none: nothing comes so far in a substep that matters.
  static constexpr double kMargin = 0.02;
  /// [m] what is none is apart.
  static constexpr double kFar = 1e9;

  struct Spot {
    Vector<Real> position;  ///< [m]
    /// Unit vectors: from the pair's first link towards its second, and two across.
    Vector<Real> directions[3];
    Real distance;  ///< [m] negative where links overlap; kFar where there is none
    bool any;       ///< in some lane there is one
  };

  explicit LinkContacts(const Topology& topology) : topology_(topology) {
    for (const Topology::Pair& pair : topology.pairs) spots_.resize(spots_.size() + pair.spots);
  }

  size_t size() const { return spots_.size(); }
  const Spot& operator[](size_t spot) const { return spots_[spot]; }

  /// Looks where they are now. @param tree after MoveTo.
  void Find(const Physics<Real>& physics, const SpatialTree<Real>& tree) {
    for (Spot& spot : spots_) spot = Nothing();
    for (int lane = 0; lane < kLanes<Real>; ++lane) {
      for (size_t i = 0; i < placed_.size(); ++i) Place(physics, tree, i, lane);
      Spot* spot = spots_.data();
      for (const Topology::Pair& pair : topology_.pairs) {
        const int count = FindNearSpots(placed_[pair.first], placed_[pair.second], kMargin, &near_);
        for (int k = 0; k < count; ++k) Write(near_[static_cast<size_t>(k)], lane, &spot[k]);
        spot += pair.spots;
      }
    }
  }

 private:
  static Spot Nothing() {
    Spot spot{};
    spot.distance += kFar;
    spot.any = false;
    return spot;
  }

  static Vector<double> LaneOf(const Vector<Real>& vector, int lane) {
    return {Lane(vector.x, lane), Lane(vector.y, lane), Lane(vector.z, lane)};
  }
  static void SetLane(const Vector<double>& from, int lane, Vector<Real>* to) {
    Lane(to->x, lane) = from.x, Lane(to->y, lane) = from.y, Lane(to->z, lane) = from.z;
  }

  void Place(const Physics<Real>& physics, const SpatialTree<Real>& tree, size_t i, int lane) {
    const Topology::Solid& solid = topology_.solids[i];
    const typename Physics<Real>::Solid& size = physics.solids[i];
    const Rotation<Real>& turned = tree.Turned(solid.link);
    const Rotation<double> link{LaneOf(turned.x, lane), LaneOf(turned.y, lane),
                                LaneOf(turned.z, lane)};
    const Vector<double> at{Lane(size.position[0], lane), Lane(size.position[1], lane),
                            Lane(size.position[2], lane)};
    PlacedSolid& placed = placed_[i];
    placed.centre = LaneOf(tree.Origin(solid.link), lane) + link * at;
    for (size_t k = 0; k < 3; ++k) {
      placed.axes[k] = link * Vector<double>::From(solid.axes + 3 * k);
      placed.half[k] = Lane(size.half[k], lane);
    }
    placed.radius = Lane(size.radius, lane);
  }

  static void Write(const NearSpot& near, int lane, Spot* spot) {
    // Across the normal: from the axis that it is least along.
    const Vector<double>& n = near.normal;
    const double x = std::abs(n.x), y = std::abs(n.y), z = std::abs(n.z);
    Vector<double> axis{0, 0, 1};
    if (x <= y && x <= z) {
      axis = {1, 0, 0};
    } else if (y <= z) {
      axis = {0, 1, 0};
    }
    const Vector<double> across = n.Cross(axis);
    const Vector<double> one = (1 / std::sqrt(across.Dot(across))) * across;
    SetLane(near.position, lane, &spot->position);
    SetLane(n, lane, &spot->directions[0]);
    SetLane(one, lane, &spot->directions[1]);
    SetLane(n.Cross(one), lane, &spot->directions[2]);
    Lane(spot->distance, lane) = near.distance;
    spot->any = true;
  }

  const Topology& topology_;
  std::vector<Spot> spots_;  // pair by pair
  std::vector<PlacedSolid> placed_ = std::vector<PlacedSolid>(topology_.solids.size());
  NearSpots near_;
};

}  // namespace plumb
