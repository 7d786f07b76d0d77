#include "calibrator/motion/touch.h"

#include <stdexcept>

namespace plumb {

Touch FindTouch(const RobotDescription& robot, const Eigen::Ref<const Eigen::VectorXd>& q) {
  if (q.size() != robot.num_positions())
    throw std::invalid_argument("the state is not one of " + robot.name);
  return TouchFinder(robot).Find(q);
}

Touch FindTouch(const RobotDescription& robot, const Transition& transition) {
  const Touch begin = FindTouch(robot, transition.q);
  if (!transition.next_q.allFinite()) return begin;
  const Touch end = FindTouch(robot, transition.next_q);
  return begin | end;
}

}  // namespace plumb
