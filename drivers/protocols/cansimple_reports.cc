#include "drivers/protocols/cansimple_reports.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <utility>

#include "common/time_units.h"

namespace plumb {
namespace {

using namespace cansimple;

constexpr double kRadiansPerTurn = 2 * std::numbers::pi;
constexpr double kSilentIntervals = 2.5;  // one heartbeat may be lost
constexpr int64_t kTogether = 1'000'000;  // [us] between silence and jump of one restart
constexpr double kLeastJump = 0.05;       // [turns] beyond what the velocities explain
// [s] that velocities explain: where a joint has been in a longer silence they do not tell
constexpr double kExplained = 0.25;
constexpr int64_t kPowerCut = 500'000;  // [us] that a drive takes to start again, at least

const Layout* Find(uint32_t command) {
  switch (command) {
    case kGetVersion.command:
      return &kGetVersion;
    case kAddress.command:
      return &kAddress;
    case kGetEncoderEstimates.command:
      return &kGetEncoderEstimates;
    case kGetTorques.command:
      return &kGetTorques;
    case kGetIq.command:
      return &kGetIq;
    case kGetTemperature.command:
      return &kGetTemperature;
    case kGetBusVoltageCurrent.command:
      return &kGetBusVoltageCurrent;
    case kGetPowers.command:
      return &kGetPowers;
    default:
      return nullptr;
  }
}

}  // namespace

FrameUse CanSimpleReports::OnFrame(const Frame& frame, int64_t now) noexcept {
  const Layout* layout = Find(frame.id & 0x1F);
  if (!layout) return FrameUse::kRejected;
  const auto values = DecodePayload(*layout, frame);
  if (!values) return FrameUse::kRejected;
  if (layout->command == kGetTemperature.command) return OnTemperatures(*values, now);
  if (!AllFinite(*layout, *values)) {
    const bool estimates = layout->command == kGetEncoderEstimates.command;
    return estimates ? FrameUse::kNotFinite : FrameUse::kRejected;
  }
  const FieldValues& v = *values;
  switch (layout->command) {
    case kGetVersion.command:
      return OnVersion(v);
    case kAddress.command:
      return OnAddress(v);
    case kGetEncoderEstimates.command:
      return OnEstimates(v, now);
    case kGetTorques.command:
      torque_estimate_ = v[1];
      break;
    case kGetBusVoltageCurrent.command:
      readings_.bus_voltage = v[0];
      readings_.bus_current = v[1];
      break;
    default:
      break;
  }
  return FrameUse::kConsumed;
}

FrameUse CanSimpleReports::OnVersion(const FieldValues& v) noexcept {
  const auto number = [&](size_t i) { return static_cast<int>(v[i]); };
  firmware_ = {number(4), number(5)};
  identity_.Set("firmware {}.{}.{}{}, hardware {}.{}.{}", number(4), number(5), number(6),
                number(7) != 0 ? " unreleased" : "", number(1), number(2), number(3));
  return FrameUse::kConsumed;
}

// A motor without a thermistor has NaN (ODrive firmware 0.5, MotorControl/thermistor.hpp), and the
// power stage's temperature counts all the same. What was a number, and no longer is, has broken:
// that frame is refused, which is seen, but a power stage is watched on.
FrameUse CanSimpleReports::OnTemperatures(const FieldValues& v, int64_t now) noexcept {
  const auto good = [](double next, double known) {
    return std::isfinite(next) || (std::isnan(next) && std::isnan(known));
  };
  if (std::isfinite(v[0])) readings_.drive_temperature = v[0];
  const bool none = std::isnan(v[0]) && std::isnan(v[1]);
  if (none || !good(v[0], readings_.drive_temperature) || !good(v[1], readings_.motor_temperature))
    return FrameUse::kRejected;
  readings_.motor_temperature = v[1];
  readings_.temperatures_at = now;
  return FrameUse::kConsumed;
}

FrameUse CanSimpleReports::OnAddress(const FieldValues& v) noexcept {
  two_drives_ = two_drives_ || (serial_number_ && *serial_number_ != v[1]);
  serial_number_ = v[1];
  return FrameUse::kConsumed;
}

FrameUse CanSimpleReports::OnEstimates(const FieldValues& v, int64_t now) noexcept {
  const MotorEstimate next{v[0] * kRadiansPerTurn, v[1] * kRadiansPerTurn};
  if (estimated_) {
    const int64_t gap = now - estimated_at_;
    if (gap > kPowerCut) away_ = {now, static_cast<double>(gap), true};
    const double seconds = std::min(kExplained, Seconds(gap));
    const double turned = std::abs(next.position - estimate_.position) / kRadiansPerTurn;
    const double fastest =
        std::max(std::abs(next.velocity), std::abs(estimate_.velocity)) / kRadiansPerTurn;
    // Twice: it may have been faster in between.
    if (turned > kLeastJump + 2 * fastest * seconds) {
      jump_ = {now, (next.position - estimate_.position) / kRadiansPerTurn, true};
      LookForRestart();
    }
  }
  estimated_ = true;
  estimated_at_ = now;
  estimate_ = next;
  LookForRestart();
  return FrameUse::kEstimate;
}

void CanSimpleReports::OnHeartbeat(int axis_state, int64_t now) noexcept {
  const int64_t gap = heartbeat_ == 0 ? 0 : now - heartbeat_;
  const bool silent =
      interval_ > 0 && static_cast<double>(gap) > kSilentIntervals * static_cast<double>(interval_);
  heartbeat_ = now;
  if (!silent) {
    interval_ = gap;
    return;
  }
  interval_ = 0;
  if (axis_state != kIdle && axis_state != kUndefined) return;
  silence_ = {now, static_cast<double>(gap), true};
  LookForRestart();
}

void CanSimpleReports::LookForRestart() noexcept {
  const auto with_silence = [this](const Event& event) {
    return silence_.seen && event.seen && std::abs(silence_.at - event.at) <= kTogether;
  };
  const bool jumped = with_silence(jump_);
  // A drive whose encoder begins to count at zero says so wherever the joint is, and no jump tells
  // of it where it had been near its zero before.
  const bool zero = with_silence(away_) && silence_.size > kPowerCut &&
                    std::abs(estimate_.position) < kLeastJump * kRadiansPerTurn;
  if (!jumped && !zero) return;
  restart_ = Restart{static_cast<int64_t>(silence_.size),
                     jumped ? std::optional(jump_.size) : std::nullopt};
  silence_.seen = away_.seen = jump_.seen = false;
}

std::optional<CanSimpleReports::Restart> CanSimpleReports::TakeRestart() noexcept {
  return std::exchange(restart_, std::nullopt);
}

}  // namespace plumb
