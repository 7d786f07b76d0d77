#include "robot/coordinate_names.h"

namespace plumb {

CoordinateNames::CoordinateNames(const RobotDescription& robot) {
  for (const JointDescription& joint : robot.joints) {
    if (joint.type == JointDescription::Type::kSpherical) {
      for (const char* part : {"/w", "/x", "/y", "/z"}) q.push_back(joint.name + part);
      for (const char* part : {"/x", "/y", "/z"}) v.push_back(joint.name + part);
    } else {
      q.push_back(joint.name);
      v.push_back(joint.name);
    }
  }
}

}  // namespace plumb
