#include "drivers/protocols/xsens_host.h"

#include <array>
#include <cmath>
#include <stdexcept>

#include "common/time_units.h"
#include "drivers/protocols/xsens.h"

namespace plumb {
namespace {

using namespace xsens;

// A quaternion of four rounded numbers; anything farther from unit length is no orientation.
constexpr double kNormTolerance = 1e-3;
constexpr int kHighestId = 0x7F;

// What is at a field's end may be anything beyond it, whatever the status says.
bool AtItsEnd(const Layout& layout, const std::array<double, 3>& values) {
  for (size_t i = 0; i < values.size(); ++i) {
    const Field& field = layout.fields[i];
    if (values[i] <= field.lowest() || values[i] >= field.highest()) return true;
  }
  return false;
}

class XsensImu : public Sensor {
 public:
  XsensImu(const SensorDescription& description, const SensorTiming& timing)
      : base_(static_cast<uint32_t>(description.base)),
        tick_(description.tick * 1e6),
        period_(Microseconds(description.period)),
        timing_(timing) {}

  std::vector<Filter> filters() const override {
    std::vector<Filter> filters;
    for (const Layout& layout : {kError, kWarning, kSampleTime, kGroupCounter, kStatusWord,
                                 kQuaternion, kRateOfTurn, kAcceleration}) {
      filters.push_back({.id = base_ + layout.command});
    }
    return filters;
  }

  SensorUse OnFrame(const Frame& frame, int64_t now) noexcept override {
    if (frame.extended || frame.remote || frame.error || frame.fd || frame.id < base_)
      return SensorUse::kNotMine;
    switch (frame.id - base_) {
      case kSampleTime.command:
        return OnSampleTime(frame, now);
      case kGroupCounter.command:
        return OnGroupCounter(frame);
      case kStatusWord.command:
        return OnPart(kStatusWord, kStatusPart, frame, now);
      case kQuaternion.command:
        return OnPart(kQuaternion, kQuaternionPart, frame, now);
      case kRateOfTurn.command:
        return OnPart(kRateOfTurn, kRatePart, frame, now);
      case kAcceleration.command:
        return OnPart(kAcceleration, kForcePart, frame, now);
      case kError.command:
      case kWarning.command:
        return OnNotice(frame);
      default:
        return SensorUse::kNotMine;
    }
  }

  void Start(int64_t) noexcept override {
    fault_ = clock_known_ = counter_known_ = false;
    parts_ = 0;
    reason_.Clear();
  }

  void Tick(int64_t now, FrameBatch&) noexcept override {
    present_ = heard_ && now - heard_at_ <= timing_.timeout;
    running_ = sampled_ && now - sampled_at_ <= timing_.timeout;
  }

  SensorState state() const noexcept override {
    if (fault_) return SensorState::kFault;
    if (!present_) return SensorState::kAbsent;
    return running_ ? SensorState::kRunning : SensorState::kStarting;
  }
  std::string_view reason() const noexcept override {
    if (fault_) return reason_.text();
    if (!present_) return heard_ ? "not heard any more" : "not heard yet";
    return running_ ? "" : "no complete sample: is it configured to send all of them?";
  }
  int64_t incomplete() const noexcept override { return incomplete_; }
  const ImuSample* imu() const noexcept override { return &sample_; }

 private:
  enum Part : unsigned {
    kTimePart = 1,
    kStatusPart = 2,
    kQuaternionPart = 4,
    kRatePart = 8,
    kForcePart = 16,
    kAllParts = 31
  };

  template <class... Args>
  void Fail(fmt::format_string<Args...> format, Args&&... args) noexcept {
    if (fault_) return;  // the first reason is the cause
    reason_.Set(format, std::forward<Args>(args)...);
    fault_ = true;
    DropSample();
  }

  void DropSample() noexcept {
    if (parts_ != 0) ++incomplete_;
    parts_ = 0;
  }

  SensorUse OnSampleTime(const Frame& frame, int64_t now) noexcept {
    const auto values = DecodePayload(kSampleTime, frame);
    if (!values) return SensorUse::kRejected;
    heard_ = present_ = true;
    heard_at_ = now;
    DropSample();
    if (fault_) return SensorUse::kConsumed;
    const auto ticks = static_cast<uint32_t>((*values)[0]);
    const auto elapsed = static_cast<int32_t>(ticks - ticks_);  // 32 bits go round
    if (clock_known_ && elapsed < 0) {
      Fail("its clock went back by {} ticks: it has restarted", -int64_t{elapsed});
      return SensorUse::kConsumed;
    }
    if (clock_known_ && elapsed == 0) return SensorUse::kRejected;  // the same sample again
    elapsed_ += clock_known_ ? elapsed : 0;
    clock_known_ = true;
    ticks_ = ticks;
    began_at_ = now;
    parts_ = kTimePart;
    return SensorUse::kConsumed;
  }

  // It follows SampleTime. A step other than 1 says that whole samples were lost, which is none of
  // ours to mend; one of 0 that this SampleTime was not its own.
  SensorUse OnGroupCounter(const Frame& frame) noexcept {
    const auto values = DecodePayload(kGroupCounter, frame);
    if (!values) return SensorUse::kRejected;
    const auto counter = static_cast<uint16_t>((*values)[0]);
    if (counter_known_ && counter == counter_) DropSample();
    counter_known_ = true;
    counter_ = counter;
    return SensorUse::kConsumed;
  }

  SensorUse OnPart(const Layout& layout, Part part, const Frame& frame, int64_t now) noexcept {
    const auto values = DecodePayload(layout, frame);
    if (!values) return SensorUse::kRejected;
    heard_ = present_ = true;
    heard_at_ = now;
    if (parts_ == 0) return SensorUse::kConsumed;  // its SampleTime was lost
    if ((parts_ & part) != 0 || 4 * (now - began_at_) > 3 * period_) {
      DropSample();
      return SensorUse::kConsumed;
    }
    parts_ |= part;
    const FieldValues& v = *values;
    switch (part) {
      case kStatusPart:
        status_ = static_cast<uint32_t>(v[0]);
        break;
      case kQuaternionPart:
        next_.orientation = {v[0], v[1], v[2], v[3]};
        break;
      case kRatePart:
        next_.rate = {v[0], v[1], v[2]};
        break;
      default:
        next_.force = {v[0], v[1], v[2]};
    }
    if (parts_ != kAllParts) return SensorUse::kConsumed;
    return Complete(now);
  }

  SensorUse Complete(int64_t now) noexcept {
    parts_ = 0;
    double square = 0;
    for (const double q : next_.orientation) square += q * q;
    const bool unit = std::abs(square - 1) < 2 * kNormTolerance;
    if (unit) {
      for (double& q : next_.orientation) q /= std::sqrt(square);
    }
    next_.orientation_valid = unit && (status_ & kOrientationValid) != 0;
    const uint32_t axes = status_ & (kForceAxes | kRateAxes | kFieldAxes);
    const bool somewhere = (status_ & kClippingDetected) != 0 && axes == 0;
    next_.rate_clipped = somewhere || (axes & kRateAxes) != 0 || AtItsEnd(kRateOfTurn, next_.rate);
    next_.force_clipped =
        somewhere || (axes & kForceAxes) != 0 || AtItsEnd(kAcceleration, next_.force);
    next_.sample_time = std::llround(static_cast<double>(elapsed_) * tick_);
    sample_ = next_;
    sampled_ = running_ = true;
    sampled_at_ = now;
    return SensorUse::kReading;
  }

  SensorUse OnNotice(const Frame& frame) noexcept {
    const auto values = DecodePayload(kError, frame);
    if (!values) return SensorUse::kRejected;
    // Code 1 of either says that it could not send all it had: incomplete samples will tell.
    if (frame.id - base_ == kError.command)
      Fail("it reports error {}", static_cast<int>((*values)[0]));
    return SensorUse::kConsumed;
  }

  const uint32_t base_;
  const double tick_;  // [us]
  const int64_t period_;
  const SensorTiming timing_;

  bool heard_ = false, present_ = false, sampled_ = false, running_ = false;
  int64_t heard_at_ = 0, sampled_at_ = 0, began_at_ = 0;
  bool clock_known_ = false, counter_known_ = false;
  uint32_t ticks_ = 0;
  int64_t elapsed_ = 0;  // ticks since the first sample
  uint16_t counter_ = 0;
  unsigned parts_ = 0;  // of the sample under way; 0 = there is none
  uint32_t status_ = 0;
  ImuSample next_, sample_;
  int64_t incomplete_ = 0;
  bool fault_ = false;
  Reason reason_;
};

}  // namespace

std::unique_ptr<Sensor> MakeXsensImu(const SensorDescription& d, const SensorTiming& timing) {
  if (d.base < 0 || d.base > 0x7FF - kHighestId) {
    throw std::invalid_argument(
        fmt::format("base {} is not in [0, {:#x}]", d.base, 0x7FF - kHighestId));
  }
  if (!(d.period > 0) || !(d.tick > 0))
    throw std::invalid_argument("an IMU needs a period and a tick");
  return std::make_unique<XsensImu>(d, timing);
}

BusDevice XsensBusDevice(const SensorDescription& description) {
  BusDevice device{.name = "", .protocol = "xsens", .messages = {}, .claims = {}};
  const int64_t period = Microseconds(description.period);
  const auto add = [&](const Layout& layout, int64_t every) {
    BusMessage message;
    message.layout = layout;
    message.id = layout.command + static_cast<uint32_t>(description.base);
    message.period = every;
    device.messages.push_back(message);
  };
  for (const Layout& layout : {kSampleTime, kStatusWord, kQuaternion, kRateOfTurn, kAcceleration})
    add(layout, period);
  for (const Layout& layout : {kError, kWarning}) add(layout, 0);
  return device;
}

}  // namespace plumb
