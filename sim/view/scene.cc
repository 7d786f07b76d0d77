#include "sim/view/scene.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace plumb {
namespace {

constexpr int kCirclePoints = 48;
constexpr double kStick = 0.02;  // [m] radius of a stick figure's limbs

double Turn(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
}

/// A stick from the link's origin to `end`.
Shape Stick(const Eigen::Vector3d& end) {
  // Not Quaterniond::FromTwoVectors: for vectors that are opposite it decomposes a matrix, which
  // the compiler needs ten seconds for.
  const Eigen::Vector3d across = Eigen::Vector3d::UnitZ().cross(end);
  const double aside = across.norm();
  const Eigen::Vector3d axis =
      aside > 0 ? Eigen::Vector3d(across / aside) : Eigen::Vector3d::UnitX();
  return {Shape::Type::kCapsule, end / 2,
          Eigen::AngleAxisd(std::atan2(aside, end.z()), axis).toRotationMatrix(),
          Eigen::Vector3d(kStick, end.norm(), 0)};
}

/// A mesh, to look at.
Shape BoxAround(const Shape& mesh) {
  Eigen::Vector3d low = mesh.corners.front(), high = low;
  for (const Eigen::Vector3d& corner : mesh.corners)
    low = low.cwiseMin(corner), high = high.cwiseMax(corner);
  return {Shape::Type::kBox, mesh.position + mesh.rotation * (low + high) / 2, mesh.rotation,
          high - low};
}

}  // namespace

std::vector<std::vector<Shape>> ShapesOf(const RobotDescription& robot) {
  std::vector<std::vector<Shape>> shapes;
  bool any = false;
  for (const LinkDescription& link : robot.links) {
    shapes.push_back(link.visuals.empty() ? link.collisions : link.visuals);
    for (Shape& shape : shapes.back()) {
      if (shape.type == Shape::Type::kMesh) shape = BoxAround(shape);
    }
    any = any || !shapes.back().empty();
  }
  if (any) return shapes;
  for (const JointDescription& joint : robot.joints) {
    auto& parent = shapes[static_cast<size_t>(joint.parent)];
    if (joint.origin.norm() > 0) parent.push_back(Stick(joint.origin));
    const Eigen::Vector3d& center = robot.links[static_cast<size_t>(joint.child)].center_of_mass;
    if (center.norm() > 0) shapes[static_cast<size_t>(joint.child)].push_back(Stick(2 * center));
  }
  return shapes;
}

// Of the links that move, in turn: told apart by everybody (Okabe and Ito, "Color Universal
// Design", 2008). Links without a shape take no colour.
Color ColorOf(const RobotDescription& robot, int link) {
  static constexpr Color kBase{0.72, 0.74, 0.76};
  static constexpr Color kLinks[] = {{0.34, 0.71, 0.91}, {0.90, 0.62, 0.00}, {0.00, 0.62, 0.45},
                                     {0.80, 0.47, 0.65}, {0.00, 0.45, 0.70}, {0.84, 0.37, 0.00}};
  if (link == 0) return kBase;
  const auto moving = std::count_if(robot.links.begin() + 1, robot.links.begin() + link,
                                    [](const LinkDescription& other) {
                                      return !other.visuals.empty() || !other.collisions.empty();
                                    });
  return kLinks[static_cast<size_t>(moving) % std::size(kLinks)];
}

std::vector<Eigen::Vector2d> ConvexHull(std::vector<Eigen::Vector2d> points) {
  std::sort(points.begin(), points.end(), [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a.x() < b.x() || (a.x() == b.x() && a.y() < b.y());
  });
  std::vector<Eigen::Vector2d> hull;
  const auto walk = [&](auto begin, auto end) {
    const size_t first = hull.size();
    for (auto point = begin; point != end; ++point) {
      while (hull.size() >= first + 2 && Turn(hull[hull.size() - 2], hull.back(), *point) <= 0)
        hull.pop_back();
      hull.push_back(*point);
    }
    hull.pop_back();  // where the other half begins
  };
  if (points.size() < 3) return points;
  walk(points.begin(), points.end());
  walk(points.rbegin(), points.rend());
  return hull;
}

Scene::Scene(const RobotDescription& robot, int across)
    : robot_(&robot), across_(across), shapes_(ShapesOf(robot)) {}

std::vector<Silhouette> Scene::Look(const Eigen::Ref<const Eigen::VectorXd>& q) const {
  std::vector<Silhouette> silhouettes;
  const std::vector<Pose> poses = LinkPoses(*robot_, q);
  for (size_t link = 0; link < poses.size(); ++link) {
    for (const Shape& shape : shapes_[link]) {
      const Eigen::Matrix3d axes = poses[link].rotation * shape.rotation;
      const Eigen::Vector3d center = poses[link].position + poses[link].rotation * shape.position;
      // x to the right is seen from -y, y to the right from +x.
      const double depth = across_ == 0 ? center.y() : -center.x();
      silhouettes.push_back({static_cast<int>(link), depth, Outline(shape, center, axes)});
    }
  }
  std::stable_sort(
      silhouettes.begin(), silhouettes.end(),
      [](const Silhouette& a, const Silhouette& b) { return a.depth > b.depth + 1e-9; });
  return silhouettes;
}

std::vector<Eigen::Vector2d> Scene::Outline(const Shape& shape, const Eigen::Vector3d& center,
                                            const Eigen::Matrix3d& axes) const {
  std::vector<Eigen::Vector2d> points;
  const auto add_ball = [&](const Eigen::Vector3d& at, double radius) {
    for (int i = 0; i < kCirclePoints; ++i) {
      const double angle = 2 * std::numbers::pi * i / kCirclePoints;
      points.push_back(Project(at) + radius * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
    }
  };
  const Eigen::Vector3d half_axis = axes.col(2) * shape.size[1] / 2;
  switch (shape.type) {
    case Shape::Type::kSphere:
      add_ball(center, shape.size[0]);
      break;
    case Shape::Type::kCapsule:
      add_ball(center + half_axis, shape.size[0]);
      add_ball(center - half_axis, shape.size[0]);
      break;
    case Shape::Type::kCylinder:
      for (int i = 0; i < kCirclePoints; ++i) {
        const double angle = 2 * std::numbers::pi * i / kCirclePoints;
        const Eigen::Vector3d rim =
            shape.size[0] * (std::cos(angle) * axes.col(0) + std::sin(angle) * axes.col(1));
        points.push_back(Project(center + half_axis + rim));
        points.push_back(Project(center - half_axis + rim));
      }
      break;
    case Shape::Type::kBox:
      for (int corner = 0; corner < 8; ++corner) {
        const Eigen::Vector3d sign(corner & 1 ? 0.5 : -0.5, corner & 2 ? 0.5 : -0.5,
                                   corner & 4 ? 0.5 : -0.5);
        points.push_back(Project(center + axes * shape.size.cwiseProduct(sign)));
      }
      break;
    case Shape::Type::kMesh:  // is a box here
      break;
  }
  return ConvexHull(std::move(points));
}

std::vector<Eigen::Vector2d> Scene::Hinges(const Eigen::Ref<const Eigen::VectorXd>& q) const {
  std::vector<Eigen::Vector2d> hinges;
  const std::vector<Pose> poses = LinkPoses(*robot_, q);
  for (const JointDescription& joint : robot_->joints) {
    if (joint.type == JointDescription::Type::kPrismatic) continue;
    // hangs in the air
    if (shapes_[static_cast<size_t>(joint.parent)].empty() && joint.passive) continue;
    hinges.push_back(Project(poses[static_cast<size_t>(joint.child)].position));
  }
  return hinges;
}

}  // namespace plumb
