#pragma once

#include <string>
#include <vector>

#include "common/config.h"
#include "robot/urdf/elements.h"
#include "robot/urdf/tree.h"

namespace plumb {

/// A joint, and what else the file says of it.
struct UrdfJoint : JointGeometry {
  double damping = 0, friction = 0;  ///< of <dynamics>, as in JointDynamics
  bool part = false;                 ///< one of those that a planar or floating joint is made of
  int line = 0, limit_line = 0;      ///< in the file; the joint's if it has no <limit>
};

/// Links and joints of a URDF file. Links behind fixed joints are merged into the link they are
/// fixed to; links[0] is the root, which does not move. Planar and floating joints are taken apart
/// as JointGeometry says: a planar joint's x is the joint frame's x axis projected into the
/// plane (its y axis if <axis> is along x), and (x, y, axis) are right-handed. A <limit>'s lower
/// and upper do not bind the parts, its effort, and <dynamics>, count for each.
///
/// Beyond the URDF standard, `<capsule radius="" length=""/>` is a solid like `<cylinder>`, with
/// its caps added at both ends.
struct UrdfModel {
  std::string file;
  std::string name;
  std::vector<LinkDescription> links;
  /// depth-first, as the file has them; joint i moves link i + 1
  std::vector<UrdfJoint> joints;
  std::vector<int> link_lines;                ///< in the file
  std::vector<std::string> warnings;          ///< elements without effect
  std::vector<std::string> contact_warnings;  ///< collision solids that do not touch the ground
  std::vector<std::string> pair_warnings;     ///< and those of the root that no link touches

  /// A mesh of <collision>, not read yet.
  struct Mesh {
    int link;               ///< index into links
    std::string link_name;  ///< in the file
    UrdfElements::Mesh mesh;
  };
  std::vector<Mesh> collision_meshes;

  /// Adds the hulls of the collision meshes to their links, and warnings of those whose format is
  /// not known or whose hull has too many corners. Once. Thread-safe but for the files and the
  /// environment, see FindMesh. @return the files that it read, each once.
  /// @throws ConfigError with the line of a mesh whose file is missing or unreadable, or if there
  /// are too many files.
  std::vector<std::string> LoadCollisionMeshes();

  /// @throws ConfigError "file:line: what"
  [[noreturn]] void Fail(int line, const std::string& what) const;
};

/// The path of the URDF that `urdf` in a robot's table [robot] names: relative to the robot's
/// folder, or else to that of the file that it extends, which has the key. Thread-safe but for the
/// files. @throws ConfigError naming the paths that it has tried.
std::string FindUrdf(Config& robot);

/// Does not know motors: effort limits may be 0, and links may have no mass.
/// @throws ConfigError "file:line: ..." for anything missing, unsupported or impossible (an inertia
/// no body can have, a cycle of joints, a joint without limits). Thread-safe but for the file.
/// @param fixed names of moving joints that hold still at zero, as fixed ones do.
/// @throws std::invalid_argument if one of them is no moving joint of the file, naming the nearest.
UrdfModel LoadUrdf(const std::string& file, const std::vector<std::string>& fixed = {});

}  // namespace plumb
