#include "robot/joint_tree.h"

#include <algorithm>
#include <stdexcept>

namespace plumb {

void RequireTree(const RobotDescription& robot) {
  for (size_t i = 0; i < robot.joints.size(); ++i) {
    const JointDescription& joint = robot.joints[i];
    if (joint.child != static_cast<int>(i) + 1 || joint.parent < 0 ||
        joint.parent > static_cast<int>(i)) {
      throw std::invalid_argument("joint '" + joint.name +
                                  "' is not in depth-first order of a tree");
    }
  }
}

std::vector<int> ChainTo(const RobotDescription& robot, int link) {
  std::vector<int> chain;
  for (int at = link; at != 0; at = robot.joints[static_cast<size_t>(chain.back())].parent)
    chain.push_back(at - 1);
  std::reverse(chain.begin(), chain.end());
  return chain;
}

}  // namespace plumb
