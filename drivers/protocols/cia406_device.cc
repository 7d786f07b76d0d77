#include "drivers/protocols/cia406_device.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace plumb {
namespace {

using namespace cia406;

constexpr int64_t kNever = std::numeric_limits<int64_t>::max();
// SDO abort codes of CiA 301.
constexpr double kNoSuchObject = 0x06020000, kValueOutOfRange = 0x06090030;

int64_t Next(int64_t period, int64_t now) {
  return period > 0 ? now - now % period + period : kNever;
}

class Encoder : public SensorDevice {
 public:
  explicit Encoder(const Cia406Device::Settings& settings)
      : settings_(settings), device_(settings, 0) {}

  std::vector<Filter> filters() const override {
    const auto filters = device_.filters();
    return {filters.begin(), filters.end()};
  }
  void OnFrame(const Frame& frame, int64_t now) override { device_.OnFrame(frame, now); }
  void Tick(int64_t now, const SensedMotion& motion, FrameBatch& out) override {
    device_.Tick(now, motion.position, out);
  }
  int64_t NextDue() const override { return device_.NextDue(); }
  void Boot(int64_t now) override { device_ = Cia406Device(settings_, now); }
  int64_t rejected() const override { return device_.rejected(); }

 private:
  Cia406Device::Settings settings_;
  Cia406Device device_;
};

}  // namespace

Cia406Device::Cia406Device(const Settings& settings, int64_t now) : settings_(settings) {
  if (settings.node < 1 || settings.node > 127 || !(settings.counts >= 1) ||
      !(settings.range >= 2) || settings.range > 4294967296. || settings.event_timer < 1000) {
    throw std::invalid_argument(
        "an encoder needs a node in [1, 127], counts, a range and an event timer");
  }
  Reboot(now);
}

std::array<Filter, 2> Cia406Device::filters() const {
  return {
      {{.id = kNmt.command}, {.id = kSdoRequest.command + static_cast<uint32_t>(settings_.node)}}};
}

void Cia406Device::Reboot(int64_t now) noexcept {
  state_ = kInPreOperational;
  boot_up_ = true;
  answer_due_ = false;
  next_position_ = kNever;
  next_heartbeat_ = Next(settings_.heartbeat_period, now);
}

void Cia406Device::Emergency(int code) noexcept {
  error_ = code;
  emergency_ = true;
}

void Cia406Device::OnFrame(const Frame& frame, int64_t now) noexcept {
  if (frame.extended || frame.error || frame.fd || frame.remote) return;
  if (frame.id == kSdoRequest.command + static_cast<uint32_t>(settings_.node))
    return OnSdo(frame, now);
  if (frame.id != kNmt.command) return;
  const auto values = DecodePayload(kNmt, frame);
  if (!values) {
    ++rejected_;
    return;
  }
  if ((*values)[1] != 0 && (*values)[1] != settings_.node) return;
  switch (static_cast<int>((*values)[0])) {
    case kStart:
      if (state_ != kOperational) next_position_ = Next(settings_.event_timer, now);
      state_ = kOperational;
      return;
    case kStop:
      state_ = kStopped;
      break;
    case kPreOperational:
      state_ = kInPreOperational;
      break;
    case kReset:
      return Reboot(now);
    default:
      ++rejected_;
      return;
  }
  next_position_ = kNever;
}

void Cia406Device::OnSdo(const Frame& frame, int64_t now) noexcept {
  const auto values = DecodePayload(kSdoRequest, frame);
  if (!values || state_ == kStopped) {  // a stopped node has no SDO
    ++rejected_;
    return;
  }
  const double index = (*values)[1], subindex = (*values)[2], data = (*values)[3];
  const auto answer = [&](SdoSpecifier specifier, double code) {
    answer_ = Make(kSdoAnswer, settings_.node, {double(specifier), index, subindex, code});
    answer_due_ = true;
  };
  if (static_cast<int>((*values)[0]) != kWrite2 || index != kPdoParameter ||
      subindex != kEventTimer)
    return answer(kAbort, kNoSuchObject);
  if (settings_.refuses_timer || data < 1 || data > 65535) return answer(kAbort, kValueOutOfRange);
  settings_.event_timer = 1000 * static_cast<int64_t>(data);
  if (operational()) next_position_ = Next(settings_.event_timer, now);
  answer(kWritten, 0);
}

int64_t Cia406Device::NextDue() const noexcept { return std::min(next_position_, next_heartbeat_); }

void Cia406Device::Tick(int64_t now, double position, FrameBatch& out) noexcept {
  const int node = settings_.node;
  if (boot_up_) out.Push(Make(kHeartbeat, node, {kBootUp}));
  boot_up_ = false;
  if (answer_due_) out.Push(answer_);
  answer_due_ = false;
  if (emergency_) out.Push(Make(kEmergency, node, {double(error_), error_ != 0 ? 1. : 0., 0}));
  emergency_ = false;
  if (now >= next_position_) {
    next_position_ = Next(settings_.event_timer, now);
    // Where within a code zero lies is a matter of mounting: in its middle, so that readings are
    // right on average.
    const double counts = std::floor(position / (2 * std::numbers::pi) * settings_.counts + 0.5);
    out.Push(
        Make(kPosition, node, {counts - std::floor(counts / settings_.range) * settings_.range}));
  }
  if (now >= next_heartbeat_) {
    next_heartbeat_ = Next(settings_.heartbeat_period, now);
    out.Push(Make(kHeartbeat, node, {double(state_)}));
  }
}

std::unique_ptr<SensorDevice> MakeCia406Device(const SensorDescription& sensor) {
  return std::make_unique<Encoder>(
      Cia406Device::Settings{.node = sensor.node, .counts = sensor.counts, .range = sensor.range});
}

}  // namespace plumb
