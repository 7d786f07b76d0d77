#include "sim/dynamics/near_boxes.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace plumb {
namespace {

using Point = Vector<double>;

/// An axis that separates the boxes, or along which they overlap.
struct Axis {
  Point normal{};  // from the first to the second
  double distance = -std::numeric_limits<double>::infinity();
  int face_of = -1;              // 0 = the first, 1 = the second; -1 = of two edges
  size_t first = 0, second = 0;  // which axes of theirs
};

/// How far a box reaches along a direction of length one.
double Extent(const PlacedSolid& box, const Point& along) {
  double extent = 0;
  for (size_t k = 0; k < 3; ++k) extent += box.half[k] * std::abs(box.axes[k].Dot(along));
  return extent;
}

Axis WidestAxis(const PlacedSolid& first, const PlacedSolid& second) {
  // A face is taken unless edges are clearly farther apart: it has more than one spot.
  constexpr double kClearly = 0.05, kNoLength = 1e-9;  // the latter in metres
  constexpr double kParallel = 1e-3;                   // sine of the angle between edges
  const Point apart = second.centre - first.centre;
  Axis widest;
  double to_beat = widest.distance;
  const auto offer = [&](const Point& normal, int face_of, size_t i, size_t j) {
    const double along = apart.Dot(normal);
    const double distance = std::abs(along) - Extent(first, normal) - Extent(second, normal);
    if (distance > to_beat) {
      widest = {std::copysign(1.0, along) * normal, distance, face_of, i, j};
      to_beat = distance + kNoLength;
    }
  };
  for (size_t i = 0; i < 3; ++i) offer(first.axes[i], 0, i, 0);
  for (size_t j = 0; j < 3; ++j) offer(second.axes[j], 1, 0, j);
  to_beat += kClearly * std::abs(widest.distance);
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < 3; ++j) {
      const Point across = first.axes[i].Cross(second.axes[j]);
      const double sine = std::sqrt(across.Dot(across));
      if (sine > kParallel) offer((1 / sine) * across, -1, i, j);
    }
  }
  return widest;
}

/// The middle of a box's edge along one of its axes, that reaches farthest along a direction.
Point MiddleOfEdge(const PlacedSolid& box, size_t edge, const Point& along) {
  Point middle = box.centre;
  for (size_t k = 0; k < 3; ++k) {
    if (k != edge) middle += std::copysign(box.half[k], box.axes[k].Dot(along)) * box.axes[k];
  }
  return middle;
}

// Of edges that are apart the axis separates, but need not be the way between them: then no spot.
int BetweenEdges(const PlacedSolid& first, const PlacedSolid& second, const Axis& axis,
                 NearSpot* spot) {
  const Point p = MiddleOfEdge(first, axis.first, axis.normal),
              q = MiddleOfEdge(second, axis.second, -1.0 * axis.normal);
  const Point& u = first.axes[axis.first];
  const Point& w = second.axes[axis.second];
  const double cosine = u.Dot(w), sine_squared = 1 - cosine * cosine, along_u = u.Dot(q - p),
               along_w = w.Dot(q - p);
  const double s = (along_u - cosine * along_w) / sine_squared,
               t = (cosine * along_u - along_w) / sine_squared;
  const double end_s = first.half[axis.first], end_t = second.half[axis.second];
  const bool beyond = std::abs(s) > end_s || std::abs(t) > end_t;
  if (beyond && axis.distance > 0) return 0;
  const Point on_first = p + std::clamp(s, -end_s, end_s) * u,
              on_second = q + std::clamp(t, -end_t, end_t) * w;
  *spot = {0.5 * (on_first + on_second), axis.normal, axis.distance};
  return 1;
}

/// A polygon of up to eight corners.
struct Polygon {
  std::array<Point, kMostSpots> corners{};
  size_t count = 0;

  /// Leaves what is at most `limit` along a direction.
  void Clip(const Point& along, double limit) {
    constexpr double kOnIt = 1e-6;  // [m] so that edges on each other are not cut anywhere
    Polygon left;
    for (size_t i = 0; i < count; ++i) {
      const Point& here = corners[i];
      const Point& next = corners[(i + 1) % count];
      const double beyond = here.Dot(along) - limit, next_beyond = next.Dot(along) - limit;
      if (beyond <= kOnIt) left.Add(here);
      if ((beyond <= kOnIt) != (next_beyond <= kOnIt))
        left.Add(here + ((beyond - kOnIt) / (beyond - next_beyond)) * (next - here));
    }
    *this = left;
  }

 private:
  // A convex polygon of four corners that is cut four times has eight at most; rounding may find
  // one more, which is next to another.
  void Add(const Point& corner) {
    constexpr double kSame = 1e-6;  // [m] of two that would hold twice
    for (size_t i = 0; i < count; ++i) {
      const Point apart = corner - corners[i];
      if (apart.Dot(apart) < kSame * kSame) return;
    }
    if (count < corners.size()) corners[count++] = corner;
  }
};

/// The face of a box that looks against a direction.
Polygon Against(const PlacedSolid& box, const Point& along) {
  size_t face = 0;
  for (size_t k = 1; k < 3; ++k) {
    if (std::abs(box.axes[k].Dot(along)) > std::abs(box.axes[face].Dot(along))) face = k;
  }
  const size_t i = (face + 1) % 3, j = (face + 2) % 3;
  const Point middle =
      box.centre - std::copysign(box.half[face], box.axes[face].Dot(along)) * box.axes[face];
  const Point u = box.half[i] * box.axes[i], w = box.half[j] * box.axes[j];
  return {{middle + u + w, middle + u - w, middle - u - w, middle - u + w}, 4};
}

int OverFace(const PlacedSolid& of, const PlacedSolid& other, size_t face, const Point& outwards,
             double margin, NearSpots* spots) {
  Polygon polygon = Against(other, outwards);
  for (size_t k = 0; k < 3; ++k) {
    if (k == face) continue;
    const double middle = of.centre.Dot(of.axes[k]);
    polygon.Clip(of.axes[k], middle + of.half[k]);
    polygon.Clip(-1.0 * of.axes[k], of.half[k] - middle);
  }
  int count = 0;
  for (size_t i = 0; i < polygon.count; ++i) {
    const Point& corner = polygon.corners[i];
    const double distance = (corner - of.centre).Dot(outwards) - of.half[face];
    if (distance < margin)
      (*spots)[static_cast<size_t>(count++)] = {corner - (distance / 2) * outwards, outwards,
                                                distance};
  }
  return count;
}

}  // namespace

int NearBoxes(const PlacedSolid& first, const PlacedSolid& second, double margin,
              NearSpots* spots) {
  const Axis axis = WidestAxis(first, second);
  if (!(axis.distance < margin)) return 0;
  if (axis.face_of == 0) return OverFace(first, second, axis.first, axis.normal, margin, spots);
  if (axis.face_of == 1) {
    const int count = OverFace(second, first, axis.second, -1.0 * axis.normal, margin, spots);
    for (NearSpot& spot : *spots) spot.normal = -1.0 * spot.normal;
    return count;
  }
  return BetweenEdges(first, second, axis, spots->data());
}

}  // namespace plumb
