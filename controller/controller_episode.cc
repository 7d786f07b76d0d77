// Of controller.h: an episode, from its placing to its end.

#include <fmt/format.h>

#include <cmath>

#include "common/time_units.h"
#include "controller/controller.h"

namespace plumb {
namespace {

// place_tolerance [rad] times this is the tolerance of speed [rad/s]
constexpr double kPlaceSpeedFactor = 10;

// Third words of the random streams, so that placement, exploration and the other processes'
// streams never meet.
constexpr uint32_t kPlacementStream = 0xC0000000, kExplorationStream = 0x80000000;

}  // namespace

void Controller::BeginPlacing(int64_t now, int64_t utime) {
  place_robot_t place{};
  place.utime = utime;
  place.num_positions = robot_.num_positions();
  place.num_velocities = robot_.num_velocities();
  Eigen::VectorXd q(robot_.num_positions()), v(robot_.num_velocities());
  Random random(seed_, {static_cast<uint32_t>(status_.policy_iteration),
                        static_cast<uint32_t>(attempt_++), kPlacementStream});
  task_->InitialState(random, q, v);
  place.q.assign(q.begin(), q.end());
  place.v.assign(v.begin(), v.end());
  status_.step = 0;
  status_.episode_return = 0;
  record_ = {};
  Enter(controller_status_t::PLACING);
  let_go_ = false;
  if (rest_ < 0) place_ = std::move(place);
  placing_since_ = now;
}

bool Controller::ReadyToRun(const robot_state_t& state, int64_t now) const {
  return rest_ < 0 ? Placed(state) : now - placing_since_ >= Microseconds(rest_);
}

bool Controller::Placed(const robot_state_t& state) const {
  const double tolerance = robot_.controller.place_tolerance;
  if (state.utime <= place_->utime) return false;
  return placement_.Distance(Map(state.q), Map(place_->q)).cwiseAbs().maxCoeff() <= tolerance &&
         (Map(state.v) - Map(place_->v)).cwiseAbs().maxCoeff() <= kPlaceSpeedFactor * tolerance;
}

std::optional<joint_command_t> Controller::Act(const robot_state_t& state, int64_t utime) {
  const int64_t period = Microseconds(robot_.task.period);
  // Measurements come at their own rate: answer the one nearest to the decision's time.
  if (state.utime < next_decision_ - Microseconds(robot_.driver.measurement) / 2) return {};
  if (state.utime > next_decision_ + period / 2) {
    const int64_t interval = state.utime - next_decision_ + period;
    return Halt(
        fmt::format("a state came {:.3g} s after the one acted on, where the control period "
                    "is {:g} s",
                    Seconds(interval), robot_.task.period),
        utime);
  }
  next_decision_ += period;
  const auto q = Map(state.q), v = Map(state.v);
  if (status_.step > 0) {
    record_.Add(task_->Reward(step_q_, step_v_, effort_, q, v), StepLimit());
    status_.episode_return = record_.sum_of_rewards;
  }
  const bool fell = task_->Terminated(q, v);
  if (status_.step >= StepLimit() || fell) {
    FinishEpisode(state.sequence, fell);
    return ZeroCommand(utime);
  }
  task_->Observe(q, v, {observation_.data(), static_cast<size_t>(observation_.size())});
  Eigen::VectorXf action;
  if (decide_) {
    action = decide_(observation_, record_);
  } else if (policy_header_.purpose == policy_t::EVALUATE || Trying()) {
    action = policy_->Mean(observation_);
  } else {  // the policy's own noise excites what is to be learned
    Random random(seed_,
                  {static_cast<uint32_t>(status_.policy_iteration), static_cast<uint32_t>(attempt_),
                   kExplorationStream | static_cast<uint32_t>(status_.step)});
    action = policy_->Sample(observation_, random);
  }
  if (!action.allFinite()) return Halt("the policy's action is not finite", utime);
  task_->Effort({action.data(), static_cast<size_t>(action.size())}, effort_);

  joint_command_t command = ZeroCommand(utime);
  command.episode = episode_;
  command.step = status_.step;
  for (size_t i = 0; i < driven_.size(); ++i)
    command.effort[static_cast<size_t>(driven_[i])] = effort_[task_->action_indices()[i]];
  step_q_ = q;
  step_v_ = v;
  acted_on_ = state.sequence;
  ++status_.step;
  return command;
}

bool Controller::Trying() const {
  return policy_header_.purpose == policy_t::CALIBRATE && policy_header_.trial_steps > 0 &&
         status_.num_episodes == 0;
}

int Controller::StepLimit() const {
  const int all = most_steps_;
  if (policy_header_.purpose != policy_t::CALIBRATE || policy_header_.trial_steps <= 0) return all;
  const int trial = std::min(policy_header_.trial_steps, all);
  return Trying() ? trial : std::max(1, all - trial);
}

void Controller::FinishEpisode(int64_t last_state_sequence, bool fell) {
  status_.episode.push_back(episode_);
  status_.first_state_sequence.push_back(first_state_sequence_);
  status_.last_state_sequence.push_back(last_state_sequence);
  status_.returns.push_back(status_.episode_return);
  status_.steps.push_back(record_.steps);
  status_.late_rate.push_back(record_.late_rate);
  status_.fell.push_back(fell);
  ++status_.num_episodes;
  if (next_policy_) {
    TakePolicy();
  } else if (status_.num_episodes >= status_.episodes_wanted) {
    Enter(controller_status_t::COMPLETE);
  } else {
    Enter(controller_status_t::WAITING);
  }
  ++changes_;
}

}  // namespace plumb
