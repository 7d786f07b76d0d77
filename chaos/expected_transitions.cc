#include "chaos/expected_transitions.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "common/decoded.h"
#include "common/seal.h"
#include "plumb/driver_status_t.hpp"
#include "plumb/policy_t.hpp"

namespace plumb {
namespace {

constexpr double kGreatest = 1e9, kLeastSd = 1e-12, kOverload = 10, kPeriodTolerance = 0.2;
constexpr int64_t kOldest = 10'000'000, kAhead = 1'000'000;  // [us] of a counter

}  // namespace

ExpectedTransitions::ExpectedTransitions(const RobotDescription& robot, const std::string& bus,
                                         const SigningKey& key, int64_t beginning)
    : robot_(robot),
      space_(robot),
      bus_(bus),
      key_(key),
      beginning_(beginning),
      joints_(static_cast<size_t>(robot.num_joints())) {
  for (const JointDescription& joint : robot.joints)
    greatest_effort_ = std::max(greatest_effort_, kOverload * joint.effort_limit);
}

bool ExpectedTransitions::Believed(const lockstep_post_t& post) {
  const std::string& channel = post.topic.name;
  if (!Genuine(key_, robot_.name, bus_, channel, post.data)) return false;
  const Seal seal = *FindSeal(post.data);
  const bool in_time =
      seal.counter >= post.arrival - kOldest && seal.counter <= post.arrival + kAhead;
  if (channel == "DRIVER_STATUS" && seal.run == seal.sender && seal.run != run_ && in_time &&
      seal.counter > std::max(run_since_, beginning_)) {
    run_ = seal.run;
    run_since_ = seal.counter;
  }
  int64_t& newest = newest_.try_emplace(channel, beginning_).first->second;
  if (run_ == 0 || seal.run != run_ || !in_time || seal.counter <= newest) return false;
  newest = seal.counter;
  return true;
}

void ExpectedTransitions::Hear(const lockstep_post_t& post) {
  if (post.topic.kind == lockstep_topic_t::FRAME) return;
  const std::string& channel = post.topic.name;
  if (channel == "ROBOT_STATE_SMOOTHED") {
    const auto state = Decoded<robot_state_t>(post.data);
    if (state && Believed(post)) OnState(*state);
  } else if (channel == "JOINT_COMMAND") {
    const auto command = Decoded<joint_command_t>(post.data);
    if (command && Believed(post)) OnCommand(*command);
  } else if (channel == "CONTROLLER_STATUS") {
    const auto status = Decoded<controller_status_t>(post.data);
    if (status && Believed(post) && status->phase == controller_status_t::COMPLETE &&
        status->purpose == policy_t::CALIBRATE && status->num_episodes > 0)
      complete_ = *status;
  } else if (channel == "DRIVER_STATUS") {
    if (Decoded<driver_status_t>(post.data)) Believed(post);
  }
  if (complete_) Complete();
}

void ExpectedTransitions::OnState(const robot_state_t& state) {
  if (state.num_positions != space_.num_positions() ||
      state.num_velocities != space_.num_velocities())
    return;
  // A driver that was started again counts anew.
  if (!states_.empty() && state.sequence <= states_.rbegin()->first &&
      state.utime > states_.rbegin()->second.utime) {
    cut_off_.clear();
    for (const auto& [episode, commands] : commands_) cut_off_.insert(episode);
    states_.clear();
    commands_.clear();
  }
  states_[state.sequence] = state;
}

void ExpectedTransitions::OnCommand(const joint_command_t& command) {
  if (static_cast<size_t>(command.num_joints) == joints_ && command.episode >= 0 &&
      command.step >= 0)
    commands_[command.episode][command.step] = command.state_sequence;
}

void ExpectedTransitions::Complete() {
  const auto& last = complete_->last_state_sequence;
  const int64_t newest = states_.empty() ? -1 : states_.rbegin()->first;
  for (size_t i = 0; i < last.size(); ++i) {
    if (newest < last[i] && !cut_off_.contains(complete_->episode[i])) return;
  }
  for (size_t i = 0; i < complete_->episode.size(); ++i) {
    std::vector<Episode>& seen = episodes_[complete_->episode[i]];
    // It is said again and again.
    Episode episode = Join(complete_->episode[i], last[i]);
    if (seen.empty() || seen.back() != episode) seen.push_back(std::move(episode));
  }
  completed_[complete_->policy_iteration].insert(complete_->episode);
  complete_.reset();
}

ExpectedTransitions::Episode ExpectedTransitions::Join(int64_t episode, int64_t last_state) const {
  Episode steps;
  const auto commands = commands_.find(episode);
  if (commands == commands_.end()) return steps;
  for (auto at = commands->second.begin(); at != commands->second.end(); ++at) {
    const auto next = std::next(at);
    const bool last = next == commands->second.end();
    if (!last && next->first != at->first + 1) continue;
    if (auto step = JoinOne(at->first, at->second, last ? last_state : next->second))
      steps.push_back(std::move(*step));
  }
  return steps;
}

std::optional<ExpectedTransitions::Step> ExpectedTransitions::JoinOne(int step, int64_t from,
                                                                      int64_t to) const {
  const auto first = states_.find(from), last = states_.find(to);
  if (first == states_.end() || last == states_.end() || to <= from) return std::nullopt;
  const double period = robot_.task.period;
  const double duration = 1e-6 * static_cast<double>(last->second.utime - first->second.utime);
  if (!(std::abs(duration - period) <= kPeriodTolerance * period)) return std::nullopt;
  for (int64_t k = from; k <= to; ++k) {
    const auto state = states_.find(k);
    if (state == states_.end() || state->second.model_based) return std::nullopt;
    if (k == from) continue;
    const robot_state_t& now = state->second;
    const bool tame = std::ranges::all_of(
        now.effort, [&](double effort) { return std::abs(effort) <= greatest_effort_; });
    if (now.restarted || now.utime <= states_.at(k - 1).utime || !tame) return std::nullopt;
  }
  if (!IsPlausible(first->second) || !IsPlausible(last->second)) return std::nullopt;
  return Step{step, first->second.q, first->second.v, last->second.q, last->second.v};
}

bool ExpectedTransitions::IsPlausible(const robot_state_t& state) const {
  const auto tame = [](double x) { return std::abs(x) <= kGreatest; };
  const auto sd = [](double x) { return x == 0 || (x >= kLeastSd && x <= kGreatest); };
  const auto size = static_cast<Eigen::Index>(state.q.size());
  if (!space_.Has(Eigen::VectorXd::Map(state.q.data(), size))) return false;
  return std::ranges::all_of(state.q, tame) && std::ranges::all_of(state.v, tame) &&
         std::ranges::all_of(state.q_sd, sd) && std::ranges::all_of(state.v_sd, sd);
}

}  // namespace plumb
