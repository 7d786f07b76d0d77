#include "controller/controller.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "common/time_units.h"
#include "controller/policy_fit.h"
#include "robot/physical.h"

namespace plumb {
namespace {

// [us] after which a command of zero has reached the drives: only then touch the robot
constexpr int64_t kLetGo = 30'000;
// [us] a robot not placed by then is asked to be placed anew
constexpr int64_t kPlaceAgain = 1'000'000;
constexpr int64_t kDriverTimeout = 1'000'000;  // [us] DRIVER_STATUS comes ten times a second

// All but the time at which it was said. @param header of the policy, as it was received.
bool SameContents(const policy_t& message, const policy_t& header, const GaussianPolicy& policy) {
  return message.iteration == header.iteration && message.trained_in == header.trained_in &&
         message.purpose == header.purpose && message.episodes == header.episodes &&
         message.trial_steps == header.trial_steps && message.size == header.size &&
         message.observation_mean == header.observation_mean &&
         message.observation_scale == header.observation_scale &&
         message.action_scale == header.action_scale &&
         std::ranges::equal(message.weight, policy.parameters);
}

}  // namespace

Controller::Controller(const RobotDescription& robot, uint64_t seed, double rest)
    : robot_(robot),
      space_(robot_),
      placement_(robot_),
      task_(MakeTask(robot_)),
      driven_(robot_.driven()),
      seed_(seed),
      rest_(rest),
      most_steps_(robot.task.steps),
      step_q_(Eigen::VectorXd::Zero(robot.num_positions())),
      step_v_(Eigen::VectorXd::Zero(robot.num_velocities())),
      effort_(step_v_),
      observation_(task_->observation_size()) {
  status_.policy_iteration = -1;
  Enter(controller_status_t::WAITING, "no policy yet");
}

void Controller::Enter(int8_t phase, const std::string& reason) {
  if (status_.phase != phase || status_.reason != reason) ++changes_;
  status_.phase = phase;
  status_.reason = reason;
  if (phase != controller_status_t::PLACING) place_.reset();
  if (phase != controller_status_t::RUNNING) episode_ = -1;
}

void Controller::Play(Eigen::MatrixXf actions) {
  plays_ = true;
  most_steps_ = static_cast<int>(actions.rows());
  decide_ = [actions = std::move(actions)](const Eigen::VectorXf&, const Trial& so_far) {
    return actions.row(so_far.steps).transpose().eval();
  };
  next_header_.purpose = policy_t::CALIBRATE;
  next_header_.episodes = 1;
  TakePolicy();
}

void Controller::OnPolicy(const policy_t& message) {
  if (plays_) return;
  // Policies are repeated for those who come late; the same contents are the same policy.
  const GaussianPolicy* known = next_policy_ ? next_policy_.get() : policy_.get();
  const policy_t& header = next_policy_ ? next_header_ : policy_header_;
  if (known && SameContents(message, header, *known)) return;
  auto policy = std::make_unique<GaussianPolicy>(GaussianPolicy::FromMessage(message));
  RequireFit(*policy, robot_, *task_);
  next_policy_ = std::move(policy);
  next_header_ = message;
  next_header_.weight.clear();
  if (phase() != controller_status_t::RUNNING) TakePolicy();
}

void Controller::TakePolicy() {
  policy_ = std::move(next_policy_);
  policy_header_ = next_header_;
  status_.policy_iteration = policy_header_.iteration;
  status_.purpose = policy_header_.purpose;
  status_.episodes_wanted = policy_header_.episodes;
  status_.num_episodes = 0;
  for (auto* list : {&status_.episode, &status_.first_state_sequence, &status_.last_state_sequence})
    list->clear();
  status_.returns.clear();
  status_.steps.clear(), status_.late_rate.clear(), status_.fell.clear();
  attempt_ = 0;
  ++changes_;
  if (phase() != controller_status_t::HALTED) {
    Enter(controller_status_t::WAITING, Armed() ? "" : "the driver is not armed");
  }
}

void Controller::OnDriverStatus(const driver_status_t& status, int64_t now) {
  if (status.state != driver_status_t::ARMED) halted_ = false;
  SeeDriver(status, now);
}

void Controller::SeeDriver(const driver_status_t& status, int64_t now) {
  const bool was_armed = Armed();
  driver_state_ = status.state;
  driver_reason_ = status.reason;
  driver_heard_ = now;
  if (Armed() == was_armed) return;
  if (Armed()) {
    if (halted_) return;
    Enter(controller_status_t::WAITING, policy_ || plays_ ? "" : "no policy yet");
    state_heard_ = -1;
  } else if (phase() != controller_status_t::COMPLETE) {
    if (phase() == controller_status_t::RUNNING) ++status_.episodes_aborted;
    if (phase() != controller_status_t::HALTED) {
      Enter(controller_status_t::WAITING,
            "the driver is not armed" + (driver_reason_.empty() ? "" : ": " + driver_reason_));
    }
  }
}

joint_command_t Controller::ZeroCommand(int64_t utime) {
  const auto n = static_cast<size_t>(robot_.num_joints());
  joint_command_t command{};
  command.utime = utime;
  command.sequence = sequence_++;
  command.state_sequence = last_state_sequence_;
  command.episode = -1;
  command.step = -1;
  command.policy_iteration = status_.policy_iteration;
  command.num_joints = robot_.num_joints();
  command.effort.assign(n, 0);
  for (auto* values : {&command.position, &command.velocity, &command.kp, &command.kd})
    values->assign(n, NAN);
  return command;
}

joint_command_t Controller::Halt(const std::string& reason, int64_t utime) {
  if (phase() == controller_status_t::RUNNING) ++status_.episodes_aborted;
  halted_ = true;
  Enter(controller_status_t::HALTED, reason);
  return ZeroCommand(utime);
}

std::optional<joint_command_t> Controller::Tick(int64_t now, int64_t utime) {
  if (now - driver_heard_ > kDriverTimeout && driver_state_ != driver_status_t::ABSENT) {
    driver_status_t silent{};
    silent.state = driver_status_t::ABSENT;
    silent.reason = "it is silent";
    SeeDriver(silent, driver_heard_);  // of which nobody has said that it is disarmed
  }
  if (place_ && !let_go_ && now - placing_since_ >= kLetGo) {
    let_go_ = true;
    ++changes_;
  }
  const bool acting =
      phase() == controller_status_t::RUNNING || phase() == controller_status_t::PLACING;
  if (acting && state_heard_ >= 0 &&
      now - state_heard_ > Microseconds(robot_.controller.state_timeout) &&
      // A robot that has just been placed gives the estimator a few states to settle.
      !(phase() == controller_status_t::PLACING && now - placing_since_ < kPlaceAgain)) {
    return Halt("no valid state for too long", utime);
  }
  return {};
}

std::optional<joint_command_t> Controller::OnState(const robot_state_t& state, int64_t now,
                                                   int64_t utime) {
  if (state.num_positions != space_.num_positions() ||
      state.num_velocities != space_.num_velocities())
    return {};
  if (!IsTime(state.utime)) return {};
  const bool finite = Map(state.q).allFinite() && Map(state.v).allFinite();
  const bool rotates = space_.Has(Map(state.q));
  // A backlog brings states in quick succession that are all old: their own time tells.
  const bool late = std::abs(utime - state.utime) > Microseconds(robot_.controller.state_timeout);
  last_state_sequence_ = state.sequence;
  if (finite && rotates && state.valid && !late) state_heard_ = now;
  const bool talking = driver_state_ == driver_status_t::ARMING || Armed();
  if (!talking || phase() == controller_status_t::HALTED) return {};

  if (phase() == controller_status_t::RUNNING) {
    if (late) return Halt("the state is late", utime);
    if (finite && rotates && state.valid) return Act(state, utime);
    // How a base that only feels its legs moves, the policy has seen to.
    if (robot_.estimator.base == EstimatorSettings::Base::kLegs && record_.steps > 0)
      FinishEpisode(acted_on_, true);
    return Halt(!finite           ? "the state is not finite"
                : !rotates        ? "the state's q " + space_.Fault(Map(state.q))
                : state.restarted ? "the estimator restarted in an episode"
                                  : "the state is not valid",
                utime);
  }
  const bool good = finite && rotates && state.valid && !late;
  if (phase() == controller_status_t::PLACING && good && ReadyToRun(state, now)) {
    Enter(controller_status_t::RUNNING);
    episode_ = state.utime;
    first_state_sequence_ = state.sequence;
    next_decision_ = state.utime;
    return Act(state, utime);
  }
  if (phase() == controller_status_t::WAITING && Armed() && (policy_ || plays_) && good) {
    if (next_policy_) TakePolicy();  // it came in an episode that was aborted
    const bool more = status_.num_episodes < status_.episodes_wanted;
    if (more)
      BeginPlacing(now, utime);
    else
      Enter(controller_status_t::COMPLETE);
  } else if (phase() == controller_status_t::PLACING && rest_ < 0 &&
             now - placing_since_ > kPlaceAgain) {
    BeginPlacing(now, utime);
  }
  if (state.utime < next_decision_ &&
      next_decision_ - state.utime < Microseconds(robot_.task.period))
    return {};
  next_decision_ = state.utime + Microseconds(robot_.task.period);
  return ZeroCommand(utime);
}

}  // namespace plumb
