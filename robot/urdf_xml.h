#pragma once

#include <limits>
#include <map>
#include <string>
#include <vector>

namespace plumb {

/// What a URDF's text says beside the numbers that urdfdom reads: lines for error messages, and
/// what urdfdom has no notion of.
struct UrdfXml {
  struct Shape {
    int line = 0;
    bool capsule = false;  ///< urdfdom sees a cylinder
  };
  struct Link {
    int line = 0;
    int inertial_line = 0;
    std::vector<Shape> visuals = {},
                       /// in the file's order, as urdfdom has them; without meshes
        collisions = {};
    std::vector<int> collision_meshes = {};  ///< lines
  };
  struct Joint {
    int line = 0;
    size_t order = 0;  ///< in the file
    std::string type;
    double lower = 0, upper = 0;
    double effort = 0;                                          ///< 0 where not given
    double velocity = std::numeric_limits<double>::infinity();  ///< so where not given
    double damping = 0, friction = 0;
    int limit_line = 0;  ///< the joint's if it has no <limit>
    int axis_line = 0;   ///< the joint's if it has no <axis>
  };
  /// the same robot for urdfdom: without what we do not use, every number a finite one
  std::string text;
  int line = 1;  ///< of <robot>
  std::map<std::string, Link> links;
  std::map<std::string, Joint> joints;
  std::vector<std::string> warnings;  ///< elements that nothing reads
};

/// Checks a URDF element by element: every element and number that we use, and that the links form
/// one tree.
/// @throws ConfigError "file:line: ..."
UrdfXml ReadUrdfXml(const std::string& text, const std::string& file);

}  // namespace plumb
