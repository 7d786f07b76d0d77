#include "calibrator/gap/informing_steps.h"

#include "calibrator/gap/disturbances.h"
#include "robot/residual.h"
#include "sim/touch.h"

namespace plumb {

std::vector<Rollout> FreeSteps(const RobotDescription& robot, std::span<const Rollout> rollouts) {
  TouchFinder touch(robot, Residual::kTouchMargin);
  std::vector<Rollout> free(rollouts.begin(), rollouts.end());
  for (Rollout& rollout : free) {
    std::erase_if(rollout.transitions,
                  [&](const Transition& t) { return touch.OfStep(t.q, t.next_q).any(); });
  }
  return free;
}

std::vector<Rollout> InformingSteps(const std::shared_ptr<const Model>& model,
                                    const Eigen::VectorXd& coordinates,
                                    std::span<const Rollout> rollouts, Informed informed) {
  const RobotDescription& robot = model->description();
  switch (informed) {
    case Informed::kFree:
      return FreeSteps(robot, rollouts);
    case Informed::kBesideContacts:
      return DisturbedByContacts(model, robot.ToPhysical(coordinates), rollouts);
    default:
      return {rollouts.begin(), rollouts.end()};
  }
}

const char* Name(Informed informed) {
  switch (informed) {
    case Informed::kFree:
      return "free";
    case Informed::kBesideContacts:
      return "beside contacts";
    case Informed::kNone:
      return "none";
    default:
      return "all";
  }
}

}  // namespace plumb
