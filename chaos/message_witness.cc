#include "chaos/message_witness.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "common/decoded.h"
#include "common/driver_state_name.h"
#include "common/seal.h"
#include "plumb/calibration_status_t.hpp"
#include "plumb/controller_status_t.hpp"
#include "plumb/driver_status_t.hpp"
#include "plumb/imu_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "plumb/joint_state_t.hpp"
#include "plumb/parameter_distribution_t.hpp"
#include "plumb/policy_t.hpp"
#include "plumb/residual_function_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "plumb/training_status_t.hpp"

namespace plumb {
namespace {

template <class... Numbers>
bool Finite(const Numbers&... numbers) {
  return (std::ranges::all_of(numbers, [](auto x) { return std::isfinite(x); }) && ...);
}

/// NaN stands for what is not known.
template <class... Numbers>
bool FiniteOrUnknown(const Numbers&... numbers) {
  return (std::ranges::none_of(numbers, [](auto x) { return std::isinf(x); }) && ...);
}

// Of what counts as valid, every field that lcmtypes does not allow to be NaN is finite, and no
// other one is infinite.

bool IsFinite(const joint_state_t& m) {
  for (size_t i = 0; i < m.valid.size(); ++i) {
    const std::array others{m.velocity[i], m.effort_measured[i], m.effort_sent[i],
                            m.effort_applied[i]};
    if (m.valid[i] && !(std::isfinite(m.position[i]) && FiniteOrUnknown(others))) return false;
  }
  return true;
}

bool IsFinite(const robot_state_t& m) {
  return !m.valid || (Finite(m.q, m.v, m.q_sd, m.v_sd) && FiniteOrUnknown(m.effort));
}

bool IsFinite(const imu_t& m) {
  return Finite(m.rate, m.force) && (!m.orientation_valid || Finite(m.orientation));
}

bool IsFinite(const joint_command_t& m) {
  return Finite(m.effort) && FiniteOrUnknown(m.position, m.velocity, m.kp, m.kd);
}

bool IsFinite(const policy_t& m) {
  return Finite(m.weight, m.observation_mean, m.observation_scale, m.action_scale);
}

bool IsFinite(const residual_function_t& m) {
  return Finite(m.mean, m.scale, m.low, m.high, m.centre, m.weight, m.noise, m.bound, m.unknown);
}

bool IsFinite(const parameter_distribution_t& m) {
  // The discrepancy of a roll-out that nothing explains is infinite, and nobody acts by it.
  return Finite(m.weight, m.mean, m.covariance, m.draw, m.start) &&
         std::isfinite(m.residual_margin) &&
         std::ranges::all_of(m.residual, [](const auto& residual) { return IsFinite(residual); });
}

bool IsFinite(const calibration_status_t& m) {
  return Finite(m.mean, m.sd, m.streamed_mean, m.streamed_sd);
}

bool IsFinite(const controller_status_t& m) {
  return Finite(m.returns, m.late_rate) && std::isfinite(m.episode_return);
}

constexpr const char* kPhases[] = {"WAITING", "PLACING", "RUNNING", "COMPLETE", "HALTED"};

}  // namespace

void MessageWitness::OnStart(const std::string& name) {
  if (name == "plumb-controller") iterations_.erase("CONTROLLER_STATUS");
}

void MessageWitness::RequireRising(int64_t time, const std::string& what, int iteration) {
  const auto [known, first] = iterations_.try_emplace(what, iteration);
  if (iteration < known->second) {
    chronicle_.Violate(6, time,
                       fmt::format("{} of iteration {} after {}", what, iteration, known->second));
  }
  known->second = std::max(known->second, iteration);
}

template <class Message>
void MessageWitness::RequireFinite(int64_t time, const std::string& what, const Message& m) {
  if (!IsFinite(m)) chronicle_.Violate(3, time, what + " is valid and not finite");
}

void MessageWitness::NoteChange(int64_t time, const std::string& who, const std::string& state) {
  std::string& told = states_[who];
  if (told != state) chronicle_.AddTurn(time, who + " " + state);
  told = state;
}

void MessageWitness::OnSaid(int64_t time, const lockstep_post_t& post, const std::string& speaker) {
  if (post.topic.kind == lockstep_topic_t::FRAME || speaker.empty()) return;
  const std::string& channel = post.topic.name;
  if (channel == "JOINT_STATE") {
    if (const auto m = Decoded<joint_state_t>(post.data)) RequireFinite(time, channel, *m);
  } else if (channel == "ROBOT_STATE" || channel == "ROBOT_STATE_SMOOTHED") {
    if (const auto m = Decoded<robot_state_t>(post.data)) RequireFinite(time, channel, *m);
  } else if (channel == "IMU") {
    if (const auto m = Decoded<imu_t>(post.data)) RequireFinite(time, channel, *m);
  } else if (channel == "JOINT_COMMAND") {
    if (const auto m = Decoded<joint_command_t>(post.data)) RequireFinite(time, channel, *m);
  } else if (channel == "POLICY") {
    const auto m = Decoded<policy_t>(post.data);
    if (!m) return;
    RequireFinite(time, channel, *m);
    RequireRising(time, channel, m->iteration);
  } else if (channel == "PARAMETER_DISTRIBUTION") {
    const auto m = Decoded<parameter_distribution_t>(post.data);
    if (!m) return;
    RequireFinite(time, channel, *m);
    RequireRising(time, channel, m->iteration);
    const std::span<const uint8_t> bytes = Unsealed(post.data);
    const auto [said, first] = distributions_.try_emplace(m->iteration, bytes.begin(), bytes.end());
    if (!std::ranges::equal(said->second, bytes))
      chronicle_.Violate(6, time, fmt::format("distribution {} has changed", m->iteration));
    iteration_ = std::max(iteration_, m->iteration);
  } else if (channel == "CALIBRATION_STATUS") {
    const auto m = Decoded<calibration_status_t>(post.data);
    if (!m) return;
    RequireFinite(time, channel, *m);
    RequireRising(time, channel, m->iteration);
    NoteChange(time, "calibrator",
               fmt::format("iteration {}, {} transitions", m->iteration, m->transitions));
    // With those of a roll-out under way: what is in use when the iteration is complete.
    transitions_.try_emplace(m->iteration, m->transitions);
  } else if (channel == "TRAINING_STATUS") {
    const auto m = Decoded<training_status_t>(post.data);
    if (!m) return;
    NoteChange(time, "trainer",
               fmt::format("iteration {}{}", m->iteration, m->complete ? " complete" : ""));
    // One that was not complete may be begun anew.
    if (m->complete) RequireRising(time, channel, m->iteration);
  } else if (channel == "CONTROLLER_STATUS") {
    const auto m = Decoded<controller_status_t>(post.data);
    if (!m) return;
    NoteChange(time, "controller",
               fmt::format("policy {}: {} {}", m->policy_iteration,
                           kPhases[static_cast<unsigned char>(m->phase)], m->reason));
    RequireFinite(time, channel, *m);
    RequireRising(time, channel, m->policy_iteration);
  } else if (channel == "DRIVER_STATUS") {
    if (const auto m = Decoded<driver_status_t>(post.data)) {
      NoteChange(time, "driver", std::string(DriverStateName(m->state)) + " " + m->reason);
    }
  }
}

}  // namespace plumb
