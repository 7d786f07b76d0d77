#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "common/random.h"
#include "robot/description.h"
#include "robot/urdf/urdf.h"
#include "tests/robot/zoo.h"
#include "tests/sim/robots.h"

namespace plumb {

/// One of robots/.
RobotDescription LoadExample(const std::string& name);

Eigen::Vector3d DrawVector(Random& random, double size);

Eigen::Vector3d DrawDirection(Random& random);

/// Any position with angles up to `angle` and unit quaternions, and slides up to 1 m.
Eigen::VectorXd DrawPosition(const RobotDescription& robot, Random& random, double angle = 4);

Eigen::VectorXd DrawNumbers(Eigen::Index count, Random& random, double size);

/// The links' poses in the world by textbook: link frame in parent's = origin, rotation, motion of
/// the joint.
std::vector<Eigen::Isometry3d> LinkPoses(const RobotDescription& robot, const Eigen::VectorXd& q);

/// [J] of gravity and the joints' springs.
double PotentialEnergy(const RobotDescription& robot, const Eigen::VectorXd& q);

/// The robot with nothing left that takes energy out or puts it in.
RobotDescription Frictionless(RobotDescription robot);

/// The links and joints of a URDF text, with the pendulum's settings and nothing but gravity and
/// inertia.
RobotDescription FromUrdf(const std::string& urdf);

/// Writes URDF texts of trees that nobody would build. Equal seeds give equal trees.
class TreeWriter {
 public:
  explicit TreeWriter(uint64_t seed) : random_(seed) {}

  /// Joints of all of URDF's kinds, frames, axes and inertias askew.
  /// @param most joints, the fixed ones included.
  std::string Spatial(int most) { return Write(most, Eigen::Vector3d::Zero()); }
  /// The same with joints that only move in the plane of this normal [world axes], though their
  /// frames are askew.
  std::string Planar(int most, const Eigen::Vector3d& normal) {
    return Write(most, normal.normalized());
  }

 private:
  static std::string Text(const Eigen::Vector3d& v);
  std::string Origin(const Eigen::Vector3d& xyz, const Eigen::Vector3d& rpy);
  std::string Inertial();
  std::string Write(int most, const Eigen::Vector3d& normal);

  Random random_;
};

}  // namespace plumb
