#include "drivers/protocols/moteus_device.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
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

/// [unit of a register] of one step of an integer; 1 of what is counted. docs/protocol/registers.md
struct Scale {
  double of_int8, of_int16, of_int32;
};
Scale ScaleOf(uint32_t number) {
  switch (number) {
    case kPosition:
    case kCommandPosition:
      return {0.01, 0.0001, 0.00001};
    case kVelocity:
    case kCommandVelocity:
      return {0.1, 0.00025, 0.00001};
    case kTorque:
    case kCommandTorque:
    case kMaxTorque:
      return {0.5, 0.01, 0.001};
    case kKpScale:
    case kKdScale:
    case kIntegralScale:
      return {1. / 127, 1. / 32767, 1. / 2147483647};
    case kTimeout:
      return {0.01, 0.001, 0.000001};
    case kVoltage:
      return {0.5, 0.1, 0.001};
    case kTemperature:
    case kMotorTemperature:
      return {1, 0.1, 0.001};
    default:
      return {1, 1, 1};
  }
}
double StepOf(uint32_t number, int format) {
  const Scale scale = ScaleOf(number);
  return format == kInt8 ? scale.of_int8 : format == kInt16 ? scale.of_int16 : scale.of_int32;
}
int BytesOf(int format) { return format == kInt8 ? 1 : format == kInt16 ? 2 : 4; }

bool IsCounted(uint32_t number) { return ScaleOf(number).of_int8 == 1 && number != kTemperature; }

// Of position mode, those that are of no use here included.
bool IsWritable(uint32_t number) {
  return number == kMode || (number >= kCommandPosition && number <= 0x02D);
}

/// Bytes of an answer, up to a frame's.
struct Writer {
  void Byte(uint32_t byte) {
    if (size < bytes.size()) bytes[size++] = static_cast<uint8_t>(byte);
  }
  void Number(uint32_t number) {
    for (; number > 0x7F; number >>= 7) Byte((number & 0x7F) | 0x80);
    Byte(number);
  }
  void Refuse(Subframe error, uint32_t number) {
    Byte(error);
    Number(number);
    Number(1);
  }
  void Value(uint32_t number, int format, double value) {
    uint32_t raw = 0;
    const int count = BytesOf(format);
    const double most = std::ldexp(1, 8 * count - 1) - 1;
    if (format == kFloat) {
      raw = std::bit_cast<uint32_t>(static_cast<float>(value));
    } else if (IsCounted(number)) {
      raw = static_cast<uint32_t>(static_cast<int64_t>(value));
    } else if (!std::isfinite(value)) {
      raw = static_cast<uint32_t>(static_cast<int64_t>(-most - 1));
    } else {
      raw = static_cast<uint32_t>(
          static_cast<int64_t>(std::clamp(value / StepOf(number, format), -most, most)));
    }
    for (int byte = 0; byte < count; ++byte) Byte(raw >> 8 * byte & 0xFF);
  }

  std::array<uint8_t, 64> bytes{};
  size_t size = 0;
};

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

class MoteusDevice::Reader {
 public:
  explicit Reader(const Frame& frame) : bytes_(frame.payload()) {}

  bool empty() const { return at_ == bytes_.size(); }
  std::optional<uint32_t> Byte() {
    if (empty()) return {};
    return bytes_[at_++];
  }
  /// Seven bits a byte, the least first; the highest bit says that there are more.
  std::optional<uint32_t> Number() {
    uint32_t number = 0;
    for (int shift = 0; shift < 35; shift += 7) {
      const auto byte = Byte();
      if (!byte) return {};
      number |= (*byte & 0x7F) << std::min(shift, 31);
      if ((*byte & 0x80) == 0) return number;
    }
    return {};
  }
  /// A register's value in its unit; not-a-number for the most negative integer.
  std::optional<double> Value(uint32_t number, int format) {
    uint32_t raw = 0;
    const int count = BytesOf(format);
    for (int byte = 0; byte < count; ++byte) {
      const auto next = Byte();
      if (!next) return {};
      raw |= *next << 8 * byte;
    }
    if (format == kFloat) return std::bit_cast<float>(raw);
    const int unused = 32 - 8 * count;
    const int32_t value = static_cast<int32_t>(raw << unused) >> unused;
    if (value == std::numeric_limits<int32_t>::min() >> unused && number != kMode) return kNan;
    return value * StepOf(number, format);
  }
  std::optional<std::string_view> Text(size_t size) {
    if (bytes_.size() - at_ < size) return {};
    const std::string_view text(reinterpret_cast<const char*>(bytes_.data() + at_), size);
    at_ += size;
    return text;
  }

 private:
  std::span<const uint8_t> bytes_;
  size_t at_ = 0;
};

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
  Reader reader(frame);
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
bool MoteusDevice::Obey(Reader& reader) noexcept {
  while (!reader.empty()) {
    const uint32_t subframe = *reader.Byte();
    const int kind = subframe & 0xF0, format = subframe & 0x0C;
    if (subframe == kNothing) continue;
    if (subframe == kToMotor || subframe == kAskText) {
      const auto channel = reader.Number(), size = reader.Number();
      if (!channel || !size || *channel != 1) return false;
      if (subframe == kAskText) continue;
      const auto text = reader.Text(*size);
      if (!text) return false;
      // As its own buffer does, which holds 128.
      if (heard_.size() + text->size() <= 128) heard_ += *text;
      continue;
    }
    if (kind != kWrite && kind != kRead) return false;
    const auto count =
                   (subframe & 3) != 0 ? std::optional<uint32_t>(subframe & 3) : reader.Number(),
               first = count ? reader.Number() : count;
    if (!first) return false;
    if (kind == kRead) continue;
    for (uint32_t i = 0; i < *count; ++i) {
      const auto value = reader.Value(*first + i, format);
      if (!value) return false;
      Write(*first + i, *value);
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

// What was asked for, in the order in which it was.
Frame MoteusDevice::Answer(const Sample& sample, int64_t now) noexcept {
  Writer writer;
  const auto say = [&](size_t most) {
    const size_t size = std::min(text_.size(), most);
    writer.Byte(kFromMotor);
    writer.Number(1);
    writer.Number(static_cast<uint32_t>(size));
    for (size_t i = 0; i < size; ++i) writer.Byte(static_cast<uint8_t>(text_[i]));
    text_.erase(0, size);
  };
  Reader reader(question_);
  while (!reader.empty()) {
    const uint32_t subframe = *reader.Byte();
    const int format = subframe & 0x0C;
    if (subframe == kNothing) continue;
    if (subframe == kToMotor || subframe == kAskText) {
      const auto channel = reader.Number(), size = reader.Number();
      if (!channel || !size || *channel != 1) break;
      say(subframe == kAskText ? std::min<size_t>(*size, 32) : 32);
      if (subframe == kToMotor && !reader.Text(*size)) break;
      continue;
    }
    if ((subframe & 0xF0) > kRead) break;
    const auto count =
                   (subframe & 3) != 0 ? std::optional<uint32_t>(subframe & 3) : reader.Number(),
               first = count ? reader.Number() : count;
    if (!first) break;
    if ((subframe & 0xF0) == kWrite) {
      bool more = true;
      for (uint32_t i = 0; i < *count && more; ++i) {
        more = reader.Value(*first + i, format).has_value();
        if (more && !IsWritable(*first + i)) writer.Refuse(kWriteError, *first + i);
      }
      if (!more) break;
      continue;
    }
    std::array<double, 64> values{};
    uint32_t known = 0;
    for (; known < std::min<uint32_t>(*count, 64); ++known) {
      const auto value = Read(*first + known, sample, now);
      if (!value) break;
      values[known] = *value;
    }
    if (known < *count) {  // it says which it does not know, and nothing more
      writer.Refuse(kReadError, *first + known);
      break;
    }
    writer.Byte((subframe & 0x0F) | kReply);
    if ((subframe & 3) == 0) writer.Number(*count);
    writer.Number(*first);
    for (uint32_t i = 0; i < known; ++i) writer.Value(*first + i, format, values[i]);
  }
  // Commands of the console end with a line.
  for (size_t end = 0; (end = heard_.find('\n')) != std::string::npos; heard_.erase(0, end + 1)) {
    text_ = heard_.substr(0, end + 1) == kAskTimeoutMode
                ? std::to_string(settings_.timeout_mode) + "\r\n"
                : "ERR unknown command\r\n";
  }
  Frame frame = MakeFrame(AnswerId(settings_.node) | (question_.id >> 8 & 0x7F),
                          {std::span(writer.bytes).first(writer.size)});
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
