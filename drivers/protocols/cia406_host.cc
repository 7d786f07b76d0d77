#include "drivers/protocols/cia406_host.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "common/time_units.h"
#include "drivers/protocols/cia406.h"

namespace plumb {
namespace {

using namespace cia406;

constexpr int64_t kRetry = 500'000;            // [us] between two attempts to start it
constexpr int64_t kHeartbeatPeriod = 100'000;  // [us] assumed for the bus plan

/// [ms] of the event timer, which robot.toml's period is a whole number of.
int EventTimer(const SensorDescription& description) {
  return std::max(1, static_cast<int>(std::lround(description.period * 1e3)));
}

class Cia406Encoder : public Sensor {
 public:
  Cia406Encoder(const SensorDescription& description, const SensorTiming& timing)
      : node_(description.node),
        event_timer_(EventTimer(description)),
        range_(description.range),
        radians_per_count_(2 * std::numbers::pi / description.counts),
        counts_per_microsecond_(description.max_speed / radians_per_count_ * 1e-6),
        period_(Microseconds(description.period)),
        timing_(timing) {}

  std::vector<Filter> filters() const override {
    std::vector<Filter> filters;
    for (const Layout& layout : {kEmergency, kPosition, kSdoAnswer, kHeartbeat}) {
      filters.push_back({.id = layout.command + static_cast<uint32_t>(node_)});
    }
    return filters;
  }

  SensorUse OnFrame(const Frame& frame, int64_t now) noexcept override {
    if (frame.extended || frame.remote || frame.error || frame.fd) return SensorUse::kNotMine;
    const auto node = static_cast<uint32_t>(node_);
    if (frame.id == kPosition.command + node) return OnPosition(frame, now);
    if (frame.id == kHeartbeat.command + node) return OnHeartbeat(frame, now);
    if (frame.id == kEmergency.command + node) return OnEmergency(frame);
    if (frame.id == kSdoAnswer.command + node) return OnSdoAnswer(frame);
    return SensorUse::kNotMine;
  }

  void Start(int64_t now) noexcept override {
    state_ = SensorState::kStarting;
    reason_.Clear();
    retry_ = now;
    agreed_ = tracking_ = false;
  }

  void Tick(int64_t now, FrameBatch& out) noexcept override {
    present_ = heard_ && now - heard_at_ <= timing_.timeout;
    if (state_ == SensorState::kRunning && now - position_at_ > timing_.timeout) {
      // Its turns until then can still be counted, if it is not too long. One that is there and
      // has not agreed may have a longer period, and must be told again.
      if (!present_ || !agreed_) {
        state_ = SensorState::kStarting;
        if (present_) retry_ = now;
        agreed_ = false;
      } else {
        Fail("it is there, but has sent no position for {} ms", (now - position_at_) / 1000);
      }
    }
    // One that is sending already may do so with another period: a stopped one, say, is started by
    // what we send, but has no SDO until then.
    const bool tell =
        state_ == SensorState::kStarting || (state_ == SensorState::kRunning && !agreed_);
    if (!tell || now < retry_ || out.room() < 2) return;
    retry_ = now + kRetry;
    out.Push(Make(kSdoRequest, node_,
                  {kWrite2, double(kPdoParameter), double(kEventTimer), double(event_timer_)}));
    out.Push(Make(kNmt, node_, {kStart, double(node_)}));
  }

  void Displaced() noexcept override { tracking_ = false; }

  SensorState state() const noexcept override {
    return present_ || state_ == SensorState::kFault ? state_ : SensorState::kAbsent;
  }
  std::string_view reason() const noexcept override {
    if (state_ == SensorState::kFault) return reason_.text();
    if (!present_) return heard_ ? "not heard any more" : "not heard yet";
    return state_ == SensorState::kStarting ? "it sends no positions yet" : "";
  }
  const EncoderReading* encoder() const noexcept override { return &reading_; }

 private:
  template <class... Args>
  void Fail(fmt::format_string<Args...> format, Args&&... args) noexcept {
    if (state_ == SensorState::kFault) return;  // the first reason is the cause
    reason_.Set(format, std::forward<Args>(args)...);
    state_ = SensorState::kFault;
    tracking_ = false;
  }

  void Hear(int64_t now) noexcept {
    heard_ = present_ = true;
    heard_at_ = now;
  }

  SensorUse OnPosition(const Frame& frame, int64_t now) noexcept {
    const auto values = DecodePayload(kPosition, frame);
    if (!values || (*values)[0] >= range_) return SensorUse::kRejected;
    Hear(now);
    if (state_ == SensorState::kFault) return SensorUse::kConsumed;
    const double raw = (*values)[0];
    if (!tracking_) {
      counts_ = std::remainder(raw, range_);
    } else {
      const double step = std::remainder(raw - raw_, range_);
      // two may come at once after a delay
      const int64_t dt = std::max(now - position_at_, period_);
      const double most = counts_per_microsecond_ * static_cast<double>(dt) + 1;
      if (most >= range_ / 2) {
        Fail("no position for {} ms, in which it may have turned anywhere", dt / 1000);
        return SensorUse::kConsumed;
      }
      if (std::abs(step) > most) {
        Fail("its position jumped by {} counts in {:.3g} ms: more than {:.3g} rad/s", step,
             static_cast<double>(dt) * 1e-3, counts_per_microsecond_ * 1e6 * radians_per_count_);
        return SensorUse::kConsumed;
      }
      counts_ += step;
    }
    tracking_ = true;
    raw_ = raw;
    position_at_ = now;
    state_ = SensorState::kRunning;
    reading_.position = counts_ * radians_per_count_;
    return SensorUse::kReading;
  }

  SensorUse OnHeartbeat(const Frame& frame, int64_t now) noexcept {
    const auto values = DecodePayload(kHeartbeat, frame);
    if (!values) return SensorUse::kRejected;
    Hear(now);
    const int state = static_cast<int>((*values)[0]) & 0x7F;  // bit 7 toggles in node guarding
    if (state == kBootUp) {
      if (state_ == SensorState::kRunning) Fail("it has restarted");
      retry_ = now;
      agreed_ = false;
    } else if (state != kOperational && state_ == SensorState::kRunning) {
      Fail("it went to NMT state {:#04x}", state);
    }
    return SensorUse::kConsumed;
  }

  SensorUse OnEmergency(const Frame& frame) noexcept {
    const auto values = DecodePayload(kEmergency, frame);
    if (!values) return SensorUse::kRejected;
    const int code = static_cast<int>((*values)[0]);
    if (code != 0)
      Fail("it reports error {:#06x} (register {:#04x})", code, static_cast<int>((*values)[1]));
    return SensorUse::kConsumed;
  }

  SensorUse OnSdoAnswer(const Frame& frame) noexcept {
    const auto values = DecodePayload(kSdoAnswer, frame);
    if (!values) return SensorUse::kRejected;
    const bool mine = (*values)[1] == kPdoParameter && (*values)[2] == kEventTimer;
    if (!mine || agreed_) return SensorUse::kConsumed;
    agreed_ = static_cast<int>((*values)[0]) == kWritten;
    if (static_cast<int>((*values)[0]) == kAbort) {
      Fail("it refuses to send every {} ms (SDO abort {:#010x})", event_timer_,
           static_cast<uint32_t>((*values)[3]));
    }
    return SensorUse::kConsumed;
  }

  const int node_, event_timer_;
  const double range_, radians_per_count_, counts_per_microsecond_;
  const int64_t period_;
  const SensorTiming timing_;

  SensorState state_ = SensorState::kStarting;
  Reason reason_;
  bool heard_ = false, present_ = false;  // ever, lately
  int64_t heard_at_ = 0, position_at_ = 0;
  int64_t retry_ = std::numeric_limits<int64_t>::min();
  bool agreed_ = false;    // it has said that it sends with our period, since Start
  bool tracking_ = false;  // raw_ and position_at_ are of the last position
  double raw_ = 0, counts_ = 0;
  EncoderReading reading_;
};

}  // namespace

std::unique_ptr<Sensor> MakeCia406Encoder(const SensorDescription& d, const SensorTiming& timing) {
  if (d.node < 1 || d.node > 127) {
    throw std::invalid_argument(fmt::format("CANopen node {} is not in [1, 127]", d.node));
  }
  if (!(d.counts >= 1 && d.range >= 2 && d.range <= 4294967296. && d.period > 0 &&
        d.max_speed > 0)) {
    throw std::invalid_argument(
        "an encoder needs counts, a range of 2 to 2^32, a period and a greatest speed");
  }
  return std::make_unique<Cia406Encoder>(d, timing);
}

BusDevice Cia406BusDevice(const SensorDescription& description) {
  using Direction = BusMessage::Direction;
  BusDevice device{.name = "", .protocol = "cia406", .messages = {}, .claims = {}};
  const auto add = [&](const Layout& layout, Direction direction, int64_t period) {
    BusMessage message;
    message.layout = layout;
    message.shared = layout.command == kNmt.command;
    message.id = layout.command + (message.shared ? 0u : static_cast<uint32_t>(description.node));
    message.direction = direction;
    message.period = period;
    device.messages.push_back(message);
  };
  add(kNmt, Direction::kToDevice, 0);
  add(kEmergency, Direction::kFromDevice, 0);
  add(kPosition, Direction::kFromDevice, int64_t{1000} * EventTimer(description));
  add(kSdoAnswer, Direction::kFromDevice, 0);
  add(kSdoRequest, Direction::kToDevice, 0);
  add(kHeartbeat, Direction::kFromDevice, kHeartbeatPeriod);
  return device;
}

}  // namespace plumb
