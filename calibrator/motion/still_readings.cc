#include "calibrator/motion/still_readings.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "calibrator/motion/differences.h"
#include "common/special_numbers.h"

namespace plumb {
namespace {

/// Positions or velocities of one joint.
struct Readings {
  Eigen::VectorXd Transition::*begin;
  Eigen::VectorXd Transition::*end;
  Eigen::VectorXd Transition::*end_sd;
  Eigen::Index at, size;        // in begin and end
  Eigen::Index sd_at, sd_size;  // in end_sd
};

Readings PositionsOf(const RobotDescription& robot, int joint) {
  const JointDescription& j = robot.joints[static_cast<size_t>(joint)];
  return {&Transition::q,           &Transition::next_q, &Transition::next_q_sd,
          robot.position_of(joint), j.num_positions(),   robot.velocity_of(joint),
          j.num_velocities()};
}

Readings VelocitiesOf(const RobotDescription& robot, int joint) {
  const int size = robot.joints[static_cast<size_t>(joint)].num_velocities();
  return {&Transition::v,
          &Transition::next_v,
          &Transition::next_v_sd,
          robot.velocity_of(joint),
          size,
          robot.velocity_of(joint),
          size};
}

// @param value with which the first transition begins.
bool AreStill(const Readings& r, const Eigen::VectorXd& value,
              const std::vector<Rollout>& rollouts) {
  return std::ranges::all_of(rollouts, [&](const Rollout& rollout) {
    return std::ranges::all_of(rollout.transitions, [&](const Transition& t) {
      return (t.*r.begin).segment(r.at, r.size) == value &&
             (t.*r.end).segment(r.at, r.size) == value &&
             (t.*r.end_sd).segment(r.sd_at, r.sd_size).array().isNaN().all();
    });
  });
}

}  // namespace

std::vector<std::string> ForgetStill(const RobotDescription& robot,
                                     std::vector<Rollout>* rollouts) {
  const auto some = std::ranges::find_if(
      *rollouts, [](const Rollout& rollout) { return !rollout.transitions.empty(); });
  if (some == rollouts->end()) return {};
  const Transition first = some->transitions[0];
  const auto still = [&](const Readings& r) {
    return AreStill(r, (first.*r.begin).segment(r.at, r.size), *rollouts);
  };
  std::vector<Readings> forgotten;
  std::vector<std::string> names, unread;
  for (int i = 0; i < robot.num_joints(); ++i) {
    const std::string& joint = robot.joints[static_cast<size_t>(i)].name;
    const Readings q = PositionsOf(robot, i), v = VelocitiesOf(robot, i);
    const bool stands = still(q);
    if (stands) names.push_back("q/" + joint), forgotten.push_back(q);
    if (!still(v)) continue;
    names.push_back("v/" + joint);
    if (stands)
      forgotten.push_back(v);
    else
      unread.push_back(joint);  // it does not begin with that velocity, either
  }
  if (names.size() == 2 * robot.joints.size()) return {};
  ForgetVelocities(robot, unread, rollouts);
  for (Rollout& rollout : *rollouts) {
    for (Transition& t : rollout.transitions) {
      for (const Readings& r : forgotten) (t.*r.end).segment(r.at, r.size).setConstant(kNaN);
    }
  }
  return names;
}

std::string StillWarning(std::span<const std::string> forgotten) {
  return fmt::format("nothing is learnt from what never changed, which may have read nothing: {}",
                     fmt::join(forgotten, ", "));
}

}  // namespace plumb
