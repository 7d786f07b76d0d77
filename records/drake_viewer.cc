#include "records/drake_viewer.h"

#include <Eigen/Geometry>
#include <utility>
#include <vector>

#include "robot/kinematics.h"
#include "sim/view/scene.h"

namespace plumb {
namespace {

using Geometry = drake::lcmt_viewer_geometry_data;

/// x, y, z and w, x, y, z into arrays or vectors of floats.
template <class Position, class Quaternion>
void SetPose(const Eigen::Vector3d& position, const Eigen::Matrix3d& rotation, Position& p,
             Quaternion& q) {
  const Eigen::Quaterniond turn(rotation);
  for (int i = 0; i < 3; ++i) p[static_cast<size_t>(i)] = static_cast<float>(position[i]);
  const double wxyz[] = {turn.w(), turn.x(), turn.y(), turn.z()};
  for (size_t i = 0; i < 4; ++i) q[i] = static_cast<float>(wxyz[i]);
}

Geometry GeometryOf(const Shape& shape, const Color& color) {
  Geometry geometry{};
  const auto set = [&](int8_t type, int numbers) {
    geometry.type = type;
    for (int i = 0; i < numbers; ++i)
      geometry.float_data.push_back(static_cast<float>(shape.size[i]));
    geometry.num_float_data = numbers;
  };
  switch (shape.type) {
    case Shape::Type::kBox:
      set(Geometry::BOX, 3);
      break;
    case Shape::Type::kSphere:
      set(Geometry::SPHERE, 1);
      break;
    case Shape::Type::kCylinder:
      set(Geometry::CYLINDER, 2);
      break;
    case Shape::Type::kCapsule:
      set(Geometry::CAPSULE, 2);
      break;
    case Shape::Type::kMesh:  // is a box here
      break;
  }
  SetPose(shape.position, shape.rotation, geometry.position, geometry.quaternion);
  const double rgba[] = {color.red, color.green, color.blue, 1};
  for (size_t i = 0; i < 4; ++i) geometry.color[i] = static_cast<float>(rgba[i]);
  return geometry;
}

}  // namespace

DrakeViewer::DrakeViewer(RobotDescription robot) : robot_(std::move(robot)), load_{}, draw_{} {
  const std::vector<std::vector<Shape>> shapes = ShapesOf(robot_);
  for (size_t i = 0; i < robot_.links.size(); ++i) {
    drake::lcmt_viewer_link_data link{};
    link.name = robot_.name + "::" + robot_.links[i].name;
    for (const Shape& shape : shapes[i])
      link.geom.push_back(GeometryOf(shape, ColorOf(robot_, static_cast<int>(i))));
    link.num_geom = static_cast<int32_t>(link.geom.size());
    draw_.link_name.push_back(link.name);
    load_.link.push_back(std::move(link));
  }
  load_.num_links = draw_.num_links = static_cast<int32_t>(robot_.links.size());
  draw_.robot_num.assign(robot_.links.size(), 0);
  draw_.position.assign(robot_.links.size(), std::vector<float>(3));
  draw_.quaternion.assign(robot_.links.size(), std::vector<float>(4));
}

const drake::lcmt_viewer_draw& DrakeViewer::Draw(int64_t utime,
                                                 const Eigen::Ref<const Eigen::VectorXd>& q) {
  draw_.timestamp = utime / 1000;
  const std::vector<Pose> poses = LinkPoses(robot_, q);
  for (size_t i = 0; i < poses.size(); ++i)
    SetPose(poses[i].position, poses[i].rotation, draw_.position[i], draw_.quaternion[i]);
  return draw_;
}

}  // namespace plumb
