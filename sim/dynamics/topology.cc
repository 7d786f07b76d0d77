#include "sim/dynamics/topology.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "robot/contact_pairs.h"
#include "robot/contact_points.h"
#include "robot/joint_tree.h"
#include "sim/dynamics/narrow_phase.h"

namespace plumb {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Type = JointDescription::Type;

constexpr double kParallel = 1e-12;  // what rounding makes of exact angles

// Link axes in world axes at q = 0, the base first.
std::vector<Matrix3d> AxesAtZero(const RobotDescription& robot) {
  std::vector<Matrix3d> axes{Matrix3d::Identity()};
  for (const JointDescription& joint : robot.joints) {
    axes.push_back(axes[static_cast<size_t>(joint.parent)] * joint.rotation);
  }
  return axes;
}

// Normal of the plane in which all joints move; zero if there is none.
Vector3d FindNormal(const RobotDescription& robot, const std::vector<Matrix3d>& axes) {
  Vector3d normal = Vector3d::Zero(), slide = Vector3d::Zero();
  for (size_t i = 0; i < robot.joints.size(); ++i) {
    const JointDescription& joint = robot.joints[i];
    if (joint.type == Type::kSpherical) return Vector3d::Zero();
    const Vector3d axis = axes[i + 1] * joint.axis;
    if (joint.type != Type::kPrismatic) {
      if (normal.isZero()) normal = axis;
    } else if (slide.isZero()) {
      slide = axis;
    } else if (normal.isZero() && slide.cross(axis).norm() > kParallel) {
      normal = slide.cross(axis).normalized();
    }
  }
  if (normal.isZero()) {  // one direction only: an upright plane through it
    const Vector3d level = slide.cross(Vector3d::UnitZ());
    normal = level.norm() > kParallel ? level.normalized() : Vector3d::UnitY();
  }
  for (size_t i = 0; i < robot.joints.size(); ++i) {
    const Vector3d axis = axes[i + 1] * robot.joints[i].axis;
    const bool fits = robot.joints[i].type == Type::kPrismatic
                          ? std::abs(axis.dot(normal)) < kParallel
                          : axis.cross(normal).norm() < kParallel;
    if (!fits) return Vector3d::Zero();
  }
  return normal;
}

// Rows: working axes in world axes.
Matrix3d PlaneAxes(const Vector3d& normal) {
  Vector3d y = Vector3d::UnitZ() - normal.z() * normal;
  y = y.norm() > kParallel ? y.normalized() : Vector3d::UnitY();
  Matrix3d axes;
  axes << y.cross(normal).transpose(), y.transpose(), normal.transpose();
  return axes;
}

}  // namespace

Topology::Topology(const RobotDescription& robot) {
  RequireTree(robot);
  link_axes = AxesAtZero(robot);
  for (const ContactPoint& point : ContactPoints(robot)) points.push_back({point.link});
  const Vector3d normal = FindNormal(robot, link_axes);
  const ContactPairs touching = FindContactPairs(robot);
  planar = !normal.isZero() && (points.empty() || std::abs(normal.z()) < kParallel) &&
           touching.pairs.empty();
  if (planar) {
    world_axes = PlaneAxes(normal);
    for (Matrix3d& axes : link_axes) axes = world_axes * axes;
  }
  Vector3d::Map(up) = world_axes.col(2);
  for (const JointDescription& joint : robot.joints) AddJoint(joint);
  AddPairs(robot, touching);
  FindPattern();
  FindAnchor();
}

void Topology::AddJoint(const JointDescription& described) {
  Joint joint{};
  joint.type = described.type;
  joint.parent = described.parent;
  joint.position = positions;
  joint.velocity = velocities;
  const Matrix3d& axes = link_axes[static_cast<size_t>(described.child)];
  Vector3d axis = axes * described.axis;
  if (planar) {  // exactly so
    if (described.type == Type::kPrismatic) axis.z() = 0;
    if (described.type != Type::kPrismatic) axis = Vector3d(0, 0, axis.z() > 0 ? 1 : -1);
  }
  Vector3d::Map(joint.axis) = axis;
  Matrix3d::Map(joint.link_axes) = axes;
  joint.lower = described.lower;
  joint.upper = described.upper;
  joint.effort_limit = described.effort_limit;
  int ancestor = LastVelocity(described.parent);
  for (int k = 0; k < described.num_velocities(); ++k) {
    ancestors.push_back(ancestor);
    ancestor = velocities + k;
  }
  positions += described.num_positions();
  velocities += described.num_velocities();
  coriolis = coriolis || joint.parent != 0 || described.type == Type::kSpherical;
  joints.push_back(joint);
}

void Topology::AddPairs(const RobotDescription& robot, const ContactPairs& touching) {
  for (const ContactPairs::Solid& at : touching.solids) {
    const auto link = static_cast<size_t>(at.link);
    Solid solid{at.link, {}};
    Matrix3d::Map(solid.axes) = link_axes[link] * robot.links[link].collisions[at.shape].rotation;
    solids.push_back(solid);
  }
  for (const auto& [first, second] : touching.pairs) {
    const auto shape = [&](size_t solid) {
      const ContactPairs::Solid& at = touching.solids[solid];
      return RoundedBox(robot.links[static_cast<size_t>(at.link)].collisions[at.shape]);
    };
    int carrier = solids[second].link;
    while (carrier > solids[first].link) carrier = joints[static_cast<size_t>(carrier - 1)].parent;
    pairs.push_back({first, second, MostSpots(shape(first).half.data(), shape(second).half.data()),
                     carrier != solids[first].link});
  }
}

void Topology::FindPattern() {
  const auto n = static_cast<size_t>(velocities);
  // Of the lower triangle, row by row.
  std::vector<std::vector<bool>> filled(n, std::vector<bool>(n));
  const auto fill = [&](size_t row, int from) {
    for (int j = from; j >= 0; j = ancestors[static_cast<size_t>(j)])
      filled[row][static_cast<size_t>(j)] = true;
  };
  for (size_t i = 0; i < n; ++i) fill(i, ancestors[i]);
  for (const Pair& pair : pairs) {
    if (!pair.couples) continue;
    const int first = LastVelocity(solids[pair.first].link),
              second = LastVelocity(solids[pair.second].link);
    for (int i = std::max(first, second); i >= 0; i = ancestors[static_cast<size_t>(i)])
      fill(static_cast<size_t>(i), std::min(first, second));
  }
  pattern.assign(n, -1);
  for (size_t k = n; k-- > 0;) {
    for (size_t j = 0; j < k; ++j) {
      if (filled[k][j]) pattern[k] = static_cast<int>(j);
    }
    // What eliminating this row adds to the next.
    for (int j = 0; j < pattern[k]; ++j) {
      const auto at = static_cast<size_t>(j);
      if (filled[k][at]) filled[static_cast<size_t>(pattern[k])][at] = true;
    }
  }
}

// The chain of slides that the robot as a whole hangs on.
void Topology::FindAnchor() {
  const auto children = [&](int link) {
    return std::count_if(joints.begin(), joints.end(),
                         [link](const Joint& joint) { return joint.parent == link; });
  };
  while (anchor < static_cast<int>(joints.size()) && children(anchor) == 1 &&
         joints[static_cast<size_t>(anchor)].type == Type::kPrismatic) {
    ++anchor;
  }
}

}  // namespace plumb
