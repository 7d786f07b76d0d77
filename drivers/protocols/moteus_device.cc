#include "drivers/protocols/moteus_device.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "common/special_numbers.h"
#include "common/time_units.h"

namespace plumb {
namespace {

using namespace moteus;

constexpr int64_t kPreparation = 15'000;  // [us] made up: it measures its current sensors' zeros
constexpr int64_t kNever = std::numeric_limits<int64_t>::max();

class Drive : public MotorDevice {
 public:
  explicit Drive(const MoteusDevice::Settings& settings) : device_(settings) {}

  std::vector<Filter> filters() const override {
    const auto filters = device_.filters();
    return {filters.begin(), filters.end()};
  }
  bool OnFrame(const Frame& frame, int64_t now) override {
    const bool matters = device_.OnFrame(frame, now);
    torque_ = device_.Torque(sample_);
    return matters;
  }
  void Tick(int64_t now, const ShaftReading& shaft, FrameBatch& out) override {
    sample_ = {shaft.turns * kTurn, shaft.turns_per_second * kTurn};
    device_.Tick(now, sample_, out);
    torque_ = device_.Torque(sample_);
  }
  int64_t NextDue() const override { return device_.NextDue(); }
  double Torque() const override { return torque_; }
  void Boot(int64_t now) override {
    device_.Reboot(now, 0);
    torque_ = 0;
  }
  bool armed() const override { return device_.armed(); }
  uint32_t disarm_reason() const override { return static_cast<uint32_t>(device_.fault()); }
  int64_t rejected() const override { return device_.rejected(); }

 private:
  MoteusDevice device_;
  MoteusDevice::Sample sample_;
  double torque_ = 0;
};

}  // namespace

MoteusDevice::MoteusDevice(const Settings& settings) : settings_(settings) {
  const auto positive = [](double value) { return value > 0 && std::isfinite(value); };
  if (settings.node < 1 || settings.node > kMaxNode || !positive(settings.most_torque) ||
      settings.default_timeout < 0) {
    throw std::invalid_argument("a moteus needs an id in [1, 126] and a torque");
  }
}

std::array<Filter, 3> MoteusDevice::filters() const {
  // Whatever the number of who speaks.
  const auto node = static_cast<uint32_t>(settings_.node);
  constexpr uint32_t kTo = 0x1FFF00FF;
  return {Filter{.id = node, .mask = kTo, .extended = true},
          Filter{.id = kEverybody, .mask = kTo, .extended = true},
          Filter{.id = node, .mask = kTo & 0x7FF}};
}

bool MoteusDevice::Concerns(const Frame& frame) const noexcept {
  const uint32_t to = frame.id & 0x1FFF00FF;
  return !frame.error && !frame.remote &&
         (to == static_cast<uint32_t>(settings_.node) || to == kEverybody);
}

bool MoteusDevice::OnFrame(const Frame& frame, int64_t now) noexcept {
  if (!Concerns(frame)) return false;
  CheckTime(now);
  wish_ = -1;
  SubframeReader reader(frame);
  if (!Obey(reader)) ++rejected_;
  if (wish_ >= 0) Begin(now);
  const bool asked = (frame.id & 0x8000) != 0;
  if (asked) {
    due_ = true;
    question_ = frame;
  }
  return asked || wish_ >= 0;
}

// What is written. @return whether it was understood to its end.
bool MoteusDevice::Obey(SubframeReader& reader) noexcept {
  while (!reader.empty()) {
    const uint32_t subframe = *reader.Byte();
    const int kind = subframe & 0xF0;
    if (subframe == kNothing) continue;
    if (subframe == kToMotor || subframe == kAskText) {
      const auto size = reader.TextSize();
      if (!size) return false;
      if (subframe == kAskText) continue;
      const auto text = reader.Text(*size);
      if (!text) return false;
      // As its own buffer does, which holds 128.
      if (heard_.size() + text->size() <= 128) heard_ += *text;
      continue;
    }
    if (kind != kWrite && kind != kRead) return false;
    const auto registers = reader.RegistersOf(subframe);
    if (!registers) return false;
    if (kind == kRead) continue;
    for (uint32_t i = 0; i < registers->count; ++i) {
      const auto value = reader.Value(registers->first + i, registers->format);
      if (!value) return false;
      Write(registers->first + i, *value);
    }
  }
  return true;
}

void MoteusDevice::Write(uint32_t target, double value) noexcept {
  switch (target) {
    case kMode:
      if (!(value >= 0 && value <= kLastMode)) return;
      wish_ = static_cast<int>(value);
      command_ = {.position = 0, .kp = 1, .kd = 1, .max_torque = kNaN, .timeout = 0};
      return;
    case kCommandPosition:
      command_.position = value;
      return;
    case kCommandVelocity:
      command_.velocity = std::isnan(value) ? 0 : value;
      return;
    case kCommandTorque:
      command_.torque = value;
      return;
    case kKpScale:
      command_.kp = value;
      return;
    case kKdScale:
      command_.kd = value;
      return;
    case kMaxTorque:
      command_.max_torque = value;
      return;
    case kTimeout:
      // Not-a-number: for ever.
      command_.timeout = std::isnan(value) ? -1 : std::llround(std::clamp(value, 0., 1e6) * 1000);
      return;
    default:
      return;
  }
}

// The command that has been written.
void MoteusDevice::Begin(int64_t now) noexcept {
  if (wish_ == kStopped) {
    mode_ = kStopped;
    fault_ = 0;
    command_ = {};
    return;
  }
  if (wish_ != kPositionMode) return;  // others are of no use here
  if (mode_ == kStopped) {
    mode_ = kPreparing;
    prepared_ = now + kPreparation;
  }
  const int64_t timeout =
      command_.timeout == 0 ? settings_.default_timeout : command_.timeout * 1000;
  until_ = timeout <= 0 ? kNever : now + timeout;
}

void MoteusDevice::CheckTime(int64_t now) noexcept {
  if (mode_ == kPreparing && now >= prepared_) mode_ = kPositionMode;
  if (mode_ == kPositionMode && now >= until_) mode_ = kTimedOut;
}

void MoteusDevice::set_fault(int fault) noexcept {
  fault_ = fault;
  if (fault != 0 && fault < kFirstLimit) mode_ = kFaulted;
}

void MoteusDevice::Reboot(int64_t now, double position) noexcept {
  mode_ = kStopped;
  fault_ = 0;
  command_ = {};
  zero_ = position;
  booted_ = now;
  due_ = false;
  heard_.clear();
  text_.clear();
}

int64_t MoteusDevice::NextDue() const noexcept {
  if (mode_ == kPreparing) return prepared_;
  return mode_ == kPositionMode ? until_ : kNever;
}

double MoteusDevice::Torque(const Sample& sample) const noexcept {
  const double velocity = sample.velocity / kTurn;
  double torque = 0, most = settings_.most_torque;
  if (mode_ == kTimedOut && settings_.timeout_mode == kZeroVelocity) {
    torque = -settings_.kd * velocity;
    most = std::min(most, settings_.timeout_torque);
  } else if (mode_ == kPositionMode) {
    const double kp = command_.kp, kd = std::min(command_.kd, kp);
    if (!std::isnan(command_.position) && kp != 0)
      torque += kp * settings_.kp * (command_.position - (sample.position - zero_) / kTurn);
    torque += kd * settings_.kd * (command_.velocity - velocity) + command_.torque;
    if (std::isfinite(command_.max_torque)) most = std::clamp(command_.max_torque, 0., most);
  }
  if (std::isnan(torque)) return 0;  // where a simulation has come apart
  return std::clamp(torque, -most, most);
}

void MoteusDevice::Tick(int64_t now, const Sample& sample, FrameBatch& out) noexcept {
  CheckTime(now);
  if (!due_) return;
  due_ = false;
  out.Push(Answer(sample, now));
}

std::unique_ptr<MotorDevice> MakeMoteusDevice(const MotorDescription& motor, const DriverSettings&,
                                              const VirtualRobotSettings& settings) {
  if (!motor.moteus) throw std::invalid_argument("a moteus needs its greatest torque");
  return std::make_unique<Drive>(MoteusDevice::Settings{
      .node = motor.node,
      .default_timeout = Microseconds(settings.watchdog),
      .most_torque = motor.moteus->torque,
  });
}

}  // namespace plumb
