#include "drivers/plausibility.h"

#include <algorithm>
#include <cmath>

namespace plumb {
namespace {

/// Drives say positions as float32: of 24 bits, and the last two are noise.
constexpr double kCoarse = 0x1p-22;

double Seconds(int64_t microseconds) { return static_cast<double>(microseconds) * 1e-6; }

}  // namespace

void Plausibility::Add(int64_t time, double position, double velocity, double effort) noexcept {
  const Estimate next{time, position, velocity};
  CountDevices(time);
  const int64_t since = time - last_.time;
  if (!seen_ || since < 0) {
    placing_until_ = kNever;
    return Begin(next);
  }
  if (Jumped(next)) return Begin(next);
  if (since > settings_.lateness) return Begin(next);
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
  if (!seen_ || since < 0 || since >= kWindow * settings_.period) {
    window_ = time;
    count_ = 0;
  }
  if (++count_ > kMostInWindow) {
    Complain("{} encoder estimates in {} ms, where one device sends {}: two devices with one id?", count_,
             since / 1000, since / settings_.period + 1);
  }
}

bool Plausibility::Jumped(const Estimate& next) noexcept {
  const double jump = next.position - last_.position;
  const double seconds = Seconds(next.time - last_.time);
  const double before = std::isnan(last_.velocity) ? settings_.velocity_limit
                                                   : std::max(std::copysign(1, jump) * last_.velocity, 0.0);
  const double most = settings_.velocity_limit * (seconds + Seconds(settings_.period)) +
                      before * Seconds(settings_.lateness) + Slack(next.position);
  if (!(std::abs(jump) > most)) return false;
  if (!Placed(next)) {
    Complain("the position jumped by {:.3g} in {:.3g} ms, at a velocity limit of {:.3g} it can do {:.3g}",
             jump, seconds * 1e3, settings_.velocity_limit, most);
  }
  return true;
}

void Plausibility::LookForStuck(const Estimate& next, double effort) noexcept {
  const bool same =
      next.position == last_.position &&
      (next.velocity == last_.velocity || (std::isnan(next.velocity) && std::isnan(last_.velocity)));
  const bool pushed = std::abs(effort) >= kEffort * settings_.effort_limit;
  unchanged_ = same && pushed ? unchanged_ + (next.time - last_.time) : 0;
  if (settings_.stuck_after > 0 && unchanged_ >= settings_.stuck_after) {
    Complain(
        "encoder stuck, or the joint is blocked: position {:.5g} and velocity {:.3g} the same for {} ms at "
        "an "
        "effort of {:.3g}",
        next.position, next.velocity, unchanged_ / 1000, effort);
  }
}

void Plausibility::Compare(const Estimate& next) noexcept {
  if (std::isnan(next.velocity) || std::isnan(last_.velocity) || next.time < placing_until_ ||
      comparison_.estimates >= kWindow) {
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
  const double tolerance =
      Slack(next.position) + kDisagreement * std::max(c.moved_path, c.said_path) +
      Seconds(settings_.lateness) * (std::abs(c.first_velocity) + std::abs(next.velocity) + c.swing);
  if (std::abs(c.moved - c.said) <= tolerance) return;
  Complain("position and velocity disagree: it moved by {:.3g} in {:.0f} ms, and by {:.3g} by its velocity",
           c.moved, c.seconds * 1e3, c.said);
  c = {.first_velocity = next.velocity};
}

bool Plausibility::Placed(const Estimate& estimate) const noexcept {
  return estimate.time < placing_until_ &&
         std::abs(estimate.position - place_) <=
             place_tolerance_ + std::abs(estimate.velocity) * Seconds(settings_.lateness);
}

void Plausibility::Place(int64_t time, double position, double tolerance) noexcept {
  place_ = position;
  place_tolerance_ = tolerance;
  placing_until_ = time + kPlacing;
  // It may have been obeyed before we were told.
  if (seen_ && Placed(last_)) {
    Forgive();
    Begin(last_);
  }
}

}  // namespace plumb
