// Of driver.h: the checks while it is active: drives, encoders, sensors, commands.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/time_units.h"
#include "drivers/driver/driver.h"
#include "drivers/driver/operating_limits.h"

namespace plumb {

void Driver::CheckHealth() noexcept {
  if (!Active()) return;
  bool all_armed = true;
  for (const Joint& joint : joints_) {
    const DriveState state = joint.motor->state();
    if (state != DriveState::kArming && state != DriveState::kArmed) {
      return Fault("{}: {}", joint.name, joint.motor->reason());
    }
    if (now_ - joint.measured_at > stale_after_) {
      return Fault("{}: no encoder estimate for {} ms{}", joint.name,
                   (now_ - joint.measured_at) / 1000, joint.WhatComes());
    }
    if (!joint.watch.complaint().empty())
      return Fault("{}: {}", joint.name, joint.watch.complaint());
    if (Reason why; !WithinOperatingLimits(joint.motor->readings(), settings_, why)) {
      return Fault("{}: {}", joint.name, why.text());
    }
    all_armed = all_armed && state == DriveState::kArmed;
  }
  for (const JointSensor& sensor : sensors_) {
    if (!sensor.fresh(now_)) return Fault("{}: {}", sensor.name(), sensor.Silent(now_).text());
  }
  for (const SecondEncoder& second : second_encoders_) {
    if (Reason why; !Agree(second, why)) return Fault("{}", why.text());
  }
  if (mode_ == Mode::kArming && all_armed) {
    mode_ = Mode::kArmed;
    armed_at_ = now_;
    reason_.Clear();
  }
}

void Driver::CheckCommand() noexcept {
  if (mode_ != Mode::kArmed) return;
  const int64_t silence = now_ - (inbox_.empty() ? armed_at_ : inbox_.arrival());
  if (silence > disarm_after_) {
    const std::string_view refusal = inbox_.refusal().empty() ? forgery_ : inbox_.refusal();
    if (refusal.empty()) return Fault("no command for {} ms", silence / 1000);
    return Fault("commands refused: {} (none taken for {} ms)", refusal, silence / 1000);
  }
  if (!inbox_.empty() && inbox_.Expired(now_) && !expiry_counted_) {
    ++status_.commands_expired;
    expiry_counted_ = true;
  }
}

bool Driver::Unwatched(const Joint& joint) const noexcept {
  return mode_ == Mode::kArmed &&
         TelemetryIsStale(joint.motor->readings(), Microseconds(settings_.telemetry), now_);
}

void Driver::LookAtPositions() noexcept {
  for (Joint& joint : joints_) {
    if (joint.measured) joint.position_watch.Look(joint.latest.position);
  }
  for (Measuring& passive : passive_)
    passive.position_watch.Look(sensors_[passive.sensor].newest().position);
}

Reason Driver::Warning(const Joint& joint) const noexcept {
  Reason warning = joint.position_watch.Warning();
  if (Unwatched(joint)) {
    warning.Set("no temperatures for {} ms: if it gets too hot, nobody will know",
                (now_ - joint.motor->readings().temperatures_at) / 1000);
  }
  return warning;
}

bool Driver::Agree(const SecondEncoder& second, Reason& why) const noexcept {
  const Joint& joint = joints_[second.joint];
  const JointSensor& sensor = sensors_[second.sensor];
  if (!joint.measured || !sensor.fresh(now_)) return true;
  if (std::min(joint.measured_at, sensor.taken_at()) <= displaced_at_) return true;  // of before
  double difference = sensor.newest().position - joint.latest.position;
  // Neither knows how often the joint has turned round.
  if (joint.turns) difference = std::remainder(difference, 2 * std::numbers::pi);
  // They are not of one time: a sensor that is slow may be fresh for longer than stale_after.
  const double apart =
      std::max(settings_.stale_after, Seconds(std::abs(joint.measured_at - sensor.taken_at())));
  const double most = second.tolerance + std::abs(joint.latest.velocity) * apart;
  if (std::abs(difference) <= most) return true;
  why.Set("{}: {} measures {:.4g}, its motor {:.4g}, which differ by more than {:.3g}", joint.name,
          sensor.name(), sensor.newest().position, joint.latest.position, most);
  return false;
}

}  // namespace plumb
