#include "drivers/driver/command_inbox.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace plumb {
namespace {

constexpr int64_t kGreatestJump = 1'000'000;
constexpr int64_t kGreatestSequence = 1'000'000'000'000;  // at 1 kHz reached in thirty years

}  // namespace

CommandInbox::CommandInbox(int num_joints, int64_t expiry)
    : num_joints_(num_joints), expiry_(expiry) {
  const auto size = static_cast<size_t>(num_joints);
  for (auto* values :
       {&command_.effort, &command_.position, &command_.velocity, &command_.kp, &command_.kd}) {
    values->resize(size);
  }
}

void CommandInbox::Clear() noexcept {
  empty_ = true;
  refusal_ = {};
}

std::string_view CommandInbox::Judge(const joint_command_t& command, int64_t utime) const noexcept {
  const auto size = static_cast<size_t>(num_joints_);
  if (command.num_joints != num_joints_) return "they are for another number of joints";
  for (const auto* values :
       {&command.effort, &command.position, &command.velocity, &command.kp, &command.kd}) {
    if (values->size() != size) return "they are for another number of joints";
    if (std::ranges::any_of(*values, [](double x) { return std::isinf(x); }))
      return "a number is infinite";
  }
  const auto nan = [](double x) { return std::isnan(x); };
  const auto negative = [](double x) { return x < 0; };
  if (std::ranges::any_of(command.effort, nan)) return "an effort is not a number";
  if (std::ranges::any_of(command.kp, negative) || std::ranges::any_of(command.kd, negative)) {
    return "a gain is negative";
  }
  if (command.expiry < 0) return "their expiry is negative";
  // Not as a difference: a hostile utime must not overflow.
  if (command.utime < utime - Life(command)) return "they were computed too long ago";
  if (command.utime > utime + expiry_)
    return "they are dated in the future: are the clocks the same?";
  if (command.sequence < 0 || command.sequence > kGreatestSequence)
    return "no sequence is numbered like this";
  if (empty_) return {};
  if (command.sequence <= command_.sequence) {
    return "their sequence is behind (another controller, or one that began anew: arm again)";
  }
  if (command.sequence - command_.sequence > kGreatestJump) return "their sequence jumps";
  return {};
}

bool CommandInbox::Offer(const joint_command_t& command, int64_t now, int64_t utime) noexcept {
  refusal_ = Judge(command, utime);
  if (!refusal_.empty()) return false;
  command_ = command;
  arrival_ = now;
  expires_ = now + Life(command) - std::max(int64_t{0}, utime - command.utime);
  empty_ = false;
  return true;
}

int64_t CommandInbox::Life(const joint_command_t& command) const noexcept {
  return command.expiry > 0 ? std::min(command.expiry, expiry_) : expiry_;
}

double CommandInbox::Effort(int joint, double position, double velocity) const noexcept {
  const auto i = static_cast<size_t>(joint);
  const auto pull = [](double gain, double target, double actual) {
    return std::isnan(gain) || std::isnan(target) ? 0 : gain * (target - actual);
  };
  return command_.effort[i] + pull(command_.kp[i], command_.position[i], position) +
         pull(command_.kd[i], command_.velocity[i], velocity);
}

}  // namespace plumb
