#pragma once

#include <Eigen/Core>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "robot/urdf/tree.h"

namespace plumb {

/// The elements of a URDF file as it has them, with their lines for messages.
struct UrdfElements {
  /// <origin>: a frame in another.
  struct Pose {
    Eigen::Vector3d at = Eigen::Vector3d::Zero();        ///< [m]
    Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< of this frame in the other
    Pose operator*(const Pose& inner) const { return {at + axes * inner.at, axes * inner.axes}; }
  };
  struct Inertial {
    int line = 0;
    Pose origin;
    double mass = 0;                                    ///< [kg] >= 0
    Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  ///< [kg m^2], whatever the file says
  };
  struct Solid {
    int line = 0;
    Shape shape;
  };
  struct Mesh {
    int line = 0;
    Pose origin;
    std::string file;  ///< as it is named
    Eigen::Vector3d scale = Eigen::Vector3d::Ones();
  };
  struct Link {
    int line = 0;
    std::optional<Inertial> inertial = {};
    std::vector<Solid> visuals = {}, collisions = {};  ///< without meshes
    std::vector<Mesh> collision_meshes = {};
    std::vector<std::string> joints = {};  ///< that it carries, in the file's order
  };
  struct Joint {
    int line = 0;
    int limit_line = 0;  ///< the joint's if it has no <limit>
    int axis_line = 0;   ///< the joint's if it has no <axis>
    std::string type;    ///< fixed, revolute, continuous, prismatic, planar or floating
    std::string child = {};
    Pose origin = {};
    Eigen::Vector3d axis = Eigen::Vector3d::UnitX();  ///< of any length
    double lower = 0, upper = 0;
    double effort = 0;                                          ///< 0 where not given
    double velocity = std::numeric_limits<double>::infinity();  ///< so where not given
    double damping = 0, friction = 0;
  };
  std::string name;
  int line = 1;                       ///< of <robot>
  std::string root;                   ///< the link that no joint moves
  std::map<std::string, Link> links;  ///< by name
  std::map<std::string, Joint> joints;
  std::vector<std::string> warnings;  ///< elements that nothing reads
};

/// Checks a URDF element by element: every element and number that we use, and that the links form
/// one tree.
/// Thread-safe. @throws ConfigError "file:line: ..."
UrdfElements ReadUrdfElements(const std::string& text, const std::string& file);

}  // namespace plumb
