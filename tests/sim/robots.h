#pragma once

#include <Eigen/Geometry>
#include <cstdlib>
#include <string>

#include "robot/description.h"

namespace plumb {

/// A file of the source tree.
inline std::string SourceFile(const std::string& file) {
  const char* source = std::getenv("PLUMBLINE_SOURCE");
  return std::string(source ? source : ".") + "/" + file;
}

/// A file of robots/pendulum.
inline RobotDescription LoadPendulum(const std::string& file) {
  return LoadRobot(SourceFile("robots/pendulum/" + file));
}

/// A two-armed tree in space: slide on the base, two links in series on it, and one more arm on the
/// base; axes and frames askew, so that no term of the equations of motion vanishes. Settings from
/// the pendulum.
inline RobotDescription MakeTree() {
  RobotDescription tree = LoadPendulum("robot.toml");
  tree.parameters.clear();
  tree.virtual_robot.hidden.clear();
  const auto rotation = [](double x, double y, double z) -> Eigen::Matrix3d {
    return (Eigen::AngleAxisd(z, Eigen::Vector3d::UnitZ()) *
            Eigen::AngleAxisd(y, Eigen::Vector3d::UnitY()) *
            Eigen::AngleAxisd(x, Eigen::Vector3d::UnitX()))
        .toRotationMatrix();
  };
  const auto link = [&](const std::string& name, double mass, Eigen::Vector3d center,
                        Eigen::Vector3d moments) {
    const Eigen::Matrix3d axes = rotation(mass, 2 * mass, 3 * mass);
    return LinkDescription{name, mass, center, axes * moments.asDiagonal() * axes.transpose()};
  };
  tree.links = {{"base"},
                link("carriage", 1.3, {0.1, -0.05, 0.2}, {0.02, 0.03, 0.04}),
                link("upper", 0.8, {0.05, 0.1, 0.3}, {0.03, 0.035, 0.01}),
                link("lower", 0.5, {-0.02, 0.04, 0.25}, {0.011, 0.012, 0.004}),
                link("arm", 0.7, {0.2, 0.0, 0.1}, {0.006, 0.02, 0.021})};
  const auto joint = [&](const std::string& name, JointDescription::Type type, int parent,
                         int child, Eigen::Vector3d origin, Eigen::Matrix3d frame,
                         Eigen::Vector3d axis) {
    JointDescription result = tree.joints[0];
    result.name = name;
    result.type = type;
    result.parent = parent;
    result.child = child;
    result.origin = origin;
    result.rotation = frame;
    result.axis = axis.normalized();
    return result;
  };
  using Type = JointDescription::Type;
  tree.joints = {
      joint("rail", Type::kPrismatic, 0, 1, {0.3, 0.2, 1}, rotation(0.3, -0.2, 0.5), {1, 2, 3}),
      joint("shoulder", Type::kRevolute, 1, 2, {0.1, 0.3, 0.2}, rotation(-0.4, 0.6, 0.1),
            {0.2, 1, -0.3}),
      joint("elbow", Type::kContinuous, 2, 3, {0, 0.1, 0.6}, rotation(0.7, 0.1, -0.9), {-1, 0, 0}),
      joint("other", Type::kContinuous, 0, 4, {-0.5, 0, 0.8}, rotation(1.1, 0.4, 0), {0, 0.5, 1})};
  return tree;
}

}  // namespace plumb
