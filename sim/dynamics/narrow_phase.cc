#include "sim/dynamics/narrow_phase.h"

#include <algorithm>
#include <cmath>

#include "sim/dynamics/near_boxes.h"

namespace plumb {
namespace {

using Point = Vector<double>;

constexpr double kNoLength = 1e-12;  // [m]
constexpr double kParallel = 0.02;   // sine of the angle between rods that lie on each other

/// A capsule's or a sphere's core: points from + t along for t in [0, 1].
struct Segment {
  Point from, along;
  explicit Segment(const PlacedSolid& solid)
      : from(solid.centre - solid.half[2] * solid.axes[2]),
        along(2 * solid.half[2] * solid.axes[2]) {}
  Point At(double t) const { return from + t * along; }
  double Nearest(const Point& point) const {
    const double squared = along.Dot(along);
    return squared > 0 ? std::clamp((point - from).Dot(along) / squared, 0.0, 1.0) : 0;
  }
};

double Length(const Point& a) { return std::sqrt(a.Dot(a)); }

Point Unit(const Point& a, const Point& otherwise) {
  const double length = Length(a);
  return length > kNoLength ? (1 / length) * a : otherwise;
}

/// Between points of two cores. @param crossing the normal where the points are one.
NearSpot Spot(const Point& first, double first_radius, const Point& second, double second_radius,
              const Point& crossing) {
  NearSpot spot;
  spot.normal = Unit(second - first, crossing);
  spot.distance = Length(second - first) - first_radius - second_radius;
  spot.position = first + (first_radius + spot.distance / 2) * spot.normal;
  return spot;
}

/// Where along each segment they are nearest.
std::pair<double, double> Nearest(const Segment& first, const Segment& second) {
  const double a = first.along.Dot(first.along), b = first.along.Dot(second.along),
               c = first.along.Dot(first.from - second.from), e = second.along.Dot(second.along),
               f = second.along.Dot(first.from - second.from);
  const double area = a * e - b * b;  // squared, of what they span
  const double s = area > 1e-12 * a * e ? std::clamp((b * f - c * e) / area, 0.0, 1.0) : 0;
  const double t = second.Nearest(first.At(s));
  return {first.Nearest(second.At(t)), t};
}

int SegmentsSpots(const PlacedSolid& a, const PlacedSolid& b, NearSpot* spots) {
  const Segment first(a), second(b);
  const Point across = first.along.Cross(second.along);
  const Point crossing = Unit(across, Unit(first.along.Cross(Point{1, 2, 3}), Point{0, 0, 1}));
  const auto spot = [&](double s, double t) {
    return Spot(first.At(s), a.radius, second.At(t), b.radius, crossing);
  };
  const double both = Length(first.along) * Length(second.along);
  if (both > 0 && Length(across) < kParallel * both) {
    const double length = first.along.Dot(first.along);
    const double one = (second.from - first.from).Dot(first.along) / length,
                 other = (second.At(1) - first.from).Dot(first.along) / length;
    const double begin = std::max(0.0, std::min(one, other)),
                 end = std::min(1.0, std::max(one, other));
    if (end > begin) {
      spots[0] = spot(begin, second.Nearest(first.At(begin)));
      spots[1] = spot(end, second.Nearest(first.At(end)));
      return 2;
    }
  }
  const auto [s, t] = Nearest(first, second);
  spots[0] = spot(s, t);
  return 1;
}

/// A point's coordinates along the axes of a box, from its centre.
std::array<double, 3> Within(const PlacedSolid& box, const Point& from_centre) {
  return {from_centre.Dot(box.axes[0]), from_centre.Dot(box.axes[1]), from_centre.Dot(box.axes[2])};
}

/// Distance of a point from a box, negative within it, and the direction away from the box.
double FromBox(const PlacedSolid& box, const Point& point, std::array<double, 3>* away) {
  const std::array<double, 3> at = Within(box, point - box.centre);
  std::array<double, 3> beyond{};
  double squared = 0;
  size_t face = 0;
  for (size_t k = 0; k < 3; ++k) {
    beyond[k] = std::abs(at[k]) - box.half[k];
    if (beyond[k] > 0) squared += beyond[k] * beyond[k];
    if (beyond[k] > beyond[face]) face = k;
  }
  const double outside = std::sqrt(squared);
  for (size_t k = 0; away && k < 3; ++k) {
    const double share = outside > kNoLength ? std::max(beyond[k], 0.0) / outside : k == face;
    (*away)[k] = std::copysign(share, at[k]);
  }
  return outside > kNoLength ? outside : beyond[face];
}

/// A segment and a box: the point that is deepest; if it is over a face, where the segment begins
/// and ends to be over it.
int SegmentBoxSpots(const PlacedSolid& rod, const PlacedSolid& box, NearSpot* spots) {
  constexpr double kOnIt = 1e-6;  // [m]
  const Segment segment(rod);
  double begin = 0, end = 1;
  const bool is_point = !(rod.half[2] > 0);
  // The distance from what is convex is convex.
  for (int i = 0; i < 60 && !is_point; ++i) {
    const double third = (end - begin) / 3;
    const bool left = FromBox(box, segment.At(begin + third), nullptr) <
                      FromBox(box, segment.At(end - third), nullptr);
    (left ? end : begin) += left ? -third : third;
  }
  const Point deepest = segment.At(is_point ? 0 : (begin + end) / 2);
  std::array<double, 3> away{};
  const double distance = FromBox(box, deepest, &away);
  // Over a face: beyond that alone.
  const std::array<double, 3> at = Within(box, deepest - box.centre);
  const auto beyond = [&](size_t k) { return std::abs(at[k]) - box.half[k]; };
  size_t face = beyond(1) > beyond(0) ? 1 : 0;
  if (beyond(2) > beyond(face)) face = 2;
  const bool over_face =
      !is_point && beyond((face + 1) % 3) <= kOnIt && beyond((face + 2) % 3) <= kOnIt;
  for (size_t k = 0; over_face && k < 3; ++k) away[k] = k == face ? std::copysign(1, at[k]) : 0;
  const Point normal = away[0] * box.axes[0] + away[1] * box.axes[1] + away[2] * box.axes[2];
  const auto spot = [&](const Point& core, double from_box) {
    NearSpot near;
    near.normal = -1.0 * normal;
    near.distance = from_box - rod.radius;
    near.position = core - (rod.radius + near.distance / 2) * normal;
    return near;
  };
  spots[0] = spot(deepest, distance);
  if (!over_face) return 1;
  const std::array<double, 3> from = Within(box, segment.from - box.centre),
                              along = Within(box, segment.along);
  begin = 0, end = 1;
  for (size_t k = 0; k < 3; ++k) {
    if (k == face || along[k] == 0) continue;
    const double one = (-box.half[k] - from[k]) / along[k],
                 other = (box.half[k] - from[k]) / along[k];
    begin = std::max(begin, std::min(one, other));
    end = std::min(end, std::max(one, other));
  }
  if (!(end > begin)) return 1;
  for (const double t : {begin, end}) {
    const double height = away[face] * (from[face] + t * along[face]);
    *spots++ = spot(segment.At(t), height - box.half[face]);
  }
  return 2;
}

double Reach(const PlacedSolid& solid) {
  return solid.radius + std::sqrt(solid.half[0] * solid.half[0] + solid.half[1] * solid.half[1] +
                                  solid.half[2] * solid.half[2]);
}

}  // namespace

size_t MostSpots(const double* first, const double* second) {
  if (first[0] > 0 && second[0] > 0) return kMostSpots;
  return first[2] > 0 && second[2] > 0 ? 2 : 1;
}

int FindNearSpots(const PlacedSolid& first, const PlacedSolid& second, double margin,
                  NearSpots* spots) {
  const double apart = Length(second.centre - first.centre);
  // Not: is farther. What is not finite is near nothing.
  if (!(apart <= Reach(first) + Reach(second) + margin)) return 0;
  int count = 0;
  if (first.is_box() && second.is_box()) {
    count = NearBoxes(first, second, margin, spots);
  } else if (second.is_box()) {
    count = SegmentBoxSpots(first, second, spots->data());
  } else if (first.is_box()) {
    count = SegmentBoxSpots(second, first, spots->data());
    for (NearSpot& spot : *spots) spot.normal = -1.0 * spot.normal;
  } else {
    count = SegmentsSpots(first, second, spots->data());
  }
  const auto far = [margin](const NearSpot& spot) { return !(spot.distance < margin); };
  return static_cast<int>(std::remove_if(spots->begin(), spots->begin() + count, far) -
                          spots->begin());
}

}  // namespace plumb
