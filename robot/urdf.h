#pragma once

#include <string>
#include <vector>

#include "robot/description.h"

namespace plumb {

/// Links and joints of a URDF file. Links behind fixed joints are merged into the link they are fixed to;
/// links[0] is the root, which does not move. Revolute, continuous and prismatic joints.
struct UrdfModel {
  std::string name;
  std::vector<LinkDescription> links;
  std::vector<JointDescription> joints;  // depth-first; joint i moves link i + 1
};

/// @throws ConfigError naming the file and the element for anything missing, unsupported or impossible
/// (no positive mass, an inertia no body can have, a joint without limits).
UrdfModel LoadUrdf(const std::string& file);

}  // namespace plumb
