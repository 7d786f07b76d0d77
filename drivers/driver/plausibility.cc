#include "drivers/driver/plausibility.h"

#include <algorithm>
#include <cmath>

#include "common/time_units.h"
#include "drivers/protocols/registry.h"

namespace plumb {
namespace {

/// Drives say positions as float32: of 24 bits, and the last two are noise.
constexpr double kCoarse = 0x1p-22;

/// [rad] of a motor's shaft: coarse codes of positions, and what those of velocities add up to in a
/// window.
constexpr double kResolution = 0.05;

/// [us] in which a motor sends an encoder estimate: nothing that it sends by itself comes more
/// often.
int64_t EstimatePeriod(const MotorDescription& motor, const DriverSettings& settings) {
  int64_t period = Microseconds(settings.measurement);
  for (const BusMessage& message : MotorBusDevice(motor, settings).messages) {
    const bool from_device = message.direction == BusMessage::Direction::kFromDevice;
    if (from_device && !message.polled && message.period > 0)
      period = std::min(period, message.period);
  }
  return period;
}

}  // namespace

PlausibilitySettings PlausibilityOf(const JointDescription& joint, const DriverSettings& settings) {
  return {.velocity_limit = joint.velocity_limit,
          .effort_limit = joint.effort_limit,
          .resolution = kResolution / joint.motor.gear,
          .period = EstimatePeriod(joint.motor, settings),
          .lateness = Microseconds(settings.stale_after),
          .stuck_after = Microseconds(settings.stuck_after)};
}

void Plausibility::Add(int64_t time, double position, double velocity, double effort) noexcept {
  const Estimate next{time, position, velocity};
  CountDevices(time);
  const int64_t since = time - last_.time;
  if (!seen_ || since < 0 || Jumped(next) || since > settings_.lateness) return Begin(next);
  LookForStuck(next, effort);
  Compare(next);
  last_ = next;
}

void Plausibility::Begin(const Estimate& first) noexcept {
  seen_ = true;
  last_ = first;
  unchanged_ = 0;
  comparison_ = {.first_velocity = first.velocity};
}

double Plausibility::Slack(double position) const noexcept {
  return settings_.resolution + kCoarse * std::abs(position);
}

void Plausibility::CountDevices(int64_t time) noexcept {
  const int64_t since = time - window_;
  if (count_ == 0 || since < 0 || since >= kWindow * settings_.period) {
    crowded_ = count_ > kMaxInWindow;
    window_ = time;
    count_ = 0;
  }
  if (++count_ > kMaxInWindow) {
    crowded_ = true;
    Complain(
        "{} encoder estimates in {} ms, where one device sends {}: two devices with one id, or "
        "somebody asks for them?",
        count_, since / 1000, since / settings_.period + 1);
  }
}

bool Plausibility::Jumped(const Estimate& next) noexcept {
  const double jump = next.position - last_.position;
  const double seconds = Seconds(next.time - last_.time);
  const double before = std::isnan(last_.velocity)
                            ? settings_.velocity_limit
                            : std::max(std::copysign(1, jump) * last_.velocity, 0.0);
  const double most = settings_.velocity_limit * (seconds + Seconds(settings_.period)) +
                      before * Seconds(settings_.lateness) + Slack(next.position);
  if (!(std::abs(jump) > most)) return false;
  jumped_ = true;
  Complain(
      "the position jumped by {:.3g} in {:.3g} ms, at a velocity limit of {:.3g} it can do {:.3g}",
      jump, seconds * 1e3, settings_.velocity_limit, most);
  return true;
}

void Plausibility::LookForStuck(const Estimate& next, double effort) noexcept {
  const bool same = next.position == last_.position &&
                    (next.velocity == last_.velocity ||
                     (std::isnan(next.velocity) && std::isnan(last_.velocity)));
  const bool pushed = std::abs(effort) >= kEffort * settings_.effort_limit;
  unchanged_ = same && pushed ? unchanged_ + (next.time - last_.time) : 0;
  if (settings_.stuck_after > 0 && unchanged_ >= settings_.stuck_after) {
    Complain(
        "encoder stuck, or the joint is blocked: {:.5g} at speed {:.3g} for {} ms under an effort "
        "of {:.3g}",
        next.position, next.velocity, unchanged_ / 1000, effort);
  }
}

void Plausibility::Compare(const Estimate& next) noexcept {
  if (std::isnan(next.velocity) || std::isnan(last_.velocity) || comparison_.estimates >= kWindow) {
    comparison_ = {.first_velocity = next.velocity};
    return;
  }
  Comparison& c = comparison_;
  const double seconds = Seconds(next.time - last_.time);
  const double moved = next.position - last_.position;
  const double said = (last_.velocity + next.velocity) / 2 * seconds;
  ++c.estimates;
  c.seconds += seconds;
  c.moved += moved;
  c.said += said;
  c.moved_path += std::abs(moved);
  c.said_path += std::abs(said);
  c.swing += std::abs(next.velocity - last_.velocity);
  const double tolerance = Slack(next.position) +
                           kDisagreement * std::max(c.moved_path, c.said_path) +
                           Seconds(settings_.lateness) *
                               (std::abs(c.first_velocity) + std::abs(next.velocity) + c.swing);
  if (std::abs(c.moved - c.said) <= tolerance) return;
  Complain(
      "position and velocity disagree: it moved by {:.3g} in {:.0f} ms, and by {:.3g} by its "
      "velocity",
      c.moved, c.seconds * 1e3, c.said);
  c = {.first_velocity = next.velocity};
}

}  // namespace plumb
