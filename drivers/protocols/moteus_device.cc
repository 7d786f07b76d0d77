#include "drivers/protocols/moteus_device.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "common/time_units.h"

namespace plumb {
namespace {

using namespace moteus;

constexpr double kTurn = 2 * std::numbers::pi;  // [rad]
constexpr int64_t kPreparation = 15'000;  // [us] made up: it measures its current sensors' zeros
constexpr int64_t kNever = std::numeric_limits<int64_t>::max();
constexpr uint32_t kFirmware = 0x000107;  // made up
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Of position mode, those that are of no use here included.
bool IsWritable(uint32_t number) {
  return number == kMode || (number >= kCommandPosition && number <= 0x02D);
}

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
      command_ = {.position = 0, .kp = 1, .kd = 1, .max_torque = kNan, .timeout = 0};
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
      command_.timeout =
          std::isnan(value) ? -1 : static_cast<int64_t>(std::clamp(value, 0., 1e6) * 1000 + 0.5);
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

std::optional<double> MoteusDevice::Read(uint32_t source, const Sample& sample,
                                         int64_t now) const noexcept {
  switch (source) {
    case kMode:
      return mode_;
    case kPosition:
      return (sample.position - zero_) / kTurn;
    case kVelocity:
      return sample.velocity / kTurn;
    case kTorque:
      return Torque(sample);
    case kMotorTemperature:
      return motor_temperature_;
    case kTrajectoryComplete:
      return 0;
    case kHomeState:
      return 1;  // a place within a turn of the rotor
    case kVoltage:
      return settings_.bus_voltage;
    case kTemperature:
      return settings_.temperature;
    case kFault:
      return fault_;
    case kMilliseconds:
      return static_cast<double>(static_cast<uint32_t>((now - booted_) / 1000));
    case kFirmwareVersion:
      return kFirmware;
    case kRegisterMap:
      return settings_.register_map;
    default:
      return {};
  }
}

// As much of its console's text as there is and may come.
void MoteusDevice::Say(size_t most, SubframeWriter& writer) noexcept {
  const size_t size = std::min(text_.size(), most);
  writer.Byte(kFromMotor);
  writer.Number(1);
  writer.Number(static_cast<uint32_t>(size));
  for (size_t i = 0; i < size; ++i) writer.Byte(static_cast<uint8_t>(text_[i]));
  text_.erase(0, size);
}

// The registers, or which is the first of them that it does not know, and then nothing more.
bool MoteusDevice::Reply(uint32_t subframe, const SubframeReader::Registers& registers,
                         const Sample& sample, int64_t now, SubframeWriter& writer) const noexcept {
  const auto [count, first, format] = registers;
  std::array<double, 64> values{};
  uint32_t known = 0;
  for (; known < std::min<uint32_t>(count, 64); ++known) {
    const auto value = Read(first + known, sample, now);
    if (!value) break;
    values[known] = *value;
  }
  if (known < count) {
    writer.Refuse(kReadError, first + known);
    return false;
  }
  writer.Byte((subframe & 0x0F) | kReply);
  if ((subframe & 3) == 0) writer.Number(count);
  writer.Number(first);
  for (uint32_t i = 0; i < known; ++i) writer.Value(first + i, format, values[i]);
  return true;
}

// What was asked for, in the order in which it was.
void MoteusDevice::ReplyToAll(const Sample& sample, int64_t now, SubframeWriter& writer) noexcept {
  constexpr size_t kText = 32;
  SubframeReader reader(question_);
  while (!reader.empty()) {
    const uint32_t subframe = *reader.Byte();
    if (subframe == kNothing) continue;
    if (subframe == kToMotor || subframe == kAskText) {
      const auto size = reader.TextSize();
      if (!size) return;
      Say(subframe == kAskText ? std::min<size_t>(*size, kText) : kText, writer);
      if (subframe == kToMotor && !reader.Text(*size)) return;
      continue;
    }
    if ((subframe & 0xF0) > kRead) return;
    const auto registers = reader.RegistersOf(subframe);
    if (!registers) return;
    if ((subframe & 0xF0) == kRead) {
      if (!Reply(subframe, *registers, sample, now, writer)) return;
      continue;
    }
    for (uint32_t i = 0; i < registers->count; ++i) {
      if (!reader.Value(registers->first + i, registers->format)) return;
      if (!IsWritable(registers->first + i)) writer.Refuse(kWriteError, registers->first + i);
    }
  }
}

Frame MoteusDevice::Answer(const Sample& sample, int64_t now) noexcept {
  SubframeWriter writer;
  ReplyToAll(sample, now, writer);
  // Commands of the console end with a line.
  for (size_t end = 0; (end = heard_.find('\n')) != std::string::npos; heard_.erase(0, end + 1)) {
    text_ = heard_.substr(0, end + 1) == kAskTimeoutMode
                ? std::to_string(settings_.timeout_mode) + "\r\n"
                : "ERR unknown command\r\n";
  }
  Frame frame = MakeFrame(AnswerId(settings_.node) | (question_.id >> 8 & 0x7F), {writer.bytes()});
  frame.fd = question_.fd || frame.length > 8;
  frame.bit_rate_switch = frame.fd && question_.bit_rate_switch;
  return frame;
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
