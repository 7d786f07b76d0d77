#include "drivers/protocols/mit_device.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "common/time_units.h"

namespace plumb {
namespace {

using namespace mit;

// As the firmware does it: single precision, towards zero, and no look at the range. What is beyond
// 16 bits is lost; velocity and torque would spill over into their neighbours, from which we
// refrain. Its processor makes of too large a number the largest integer, and of not-a-number 0.
uint32_t Truncate(const Field& field, double value) {
  const auto least = static_cast<float>(field.lowest()), most = static_cast<float>(field.highest());
  const float code =
      (static_cast<float>(value) - least) * static_cast<float>(field.mask()) / (most - least);
  if (std::isnan(code)) return 0;
  if (field.bits == 16) {
    return static_cast<uint32_t>(
               static_cast<int64_t>(std::floor(std::clamp(code, -0x1p31f, 0x1p31f)))) &
           0xFFFF;
  }
  return static_cast<uint32_t>(std::clamp(code, 0.f, static_cast<float>(field.mask())));
}

class Drive : public MotorDevice {
 public:
  explicit Drive(const MitDevice::Settings& settings) : settings_(settings), device_(settings) {}

  std::vector<Filter> filters() const override { return {device_.filter()}; }
  bool OnFrame(const Frame& frame, int64_t now) override {
    device_.OnFrame(frame, now);
    torque_ = device_.Torque(sample_);
    // it answers everything
    return !frame.remote && frame.id == static_cast<uint32_t>(settings_.node);
  }
  void Tick(int64_t now, const ShaftReading& shaft, FrameBatch& out) override {
    constexpr double kTurn = 2 * std::numbers::pi;  // [rad]
    sample_ = {shaft.turns * kTurn, shaft.turns_per_second * kTurn};
    device_.Tick(now, sample_, out);
    torque_ = device_.Torque(sample_);
  }
  int64_t NextDue() const override { return device_.NextDue(); }
  double Torque() const override { return torque_; }
  void Boot(int64_t) override {
    device_ = MitDevice(settings_);
    torque_ = 0;
  }
  bool armed() const override { return device_.armed(); }
  int64_t rejected() const override { return device_.rejected(); }

 private:
  MitDevice::Settings settings_;
  MitDevice device_;
  MitDevice::Sample sample_;
  double torque_ = 0;
};

}  // namespace

MitDevice::MitDevice(const Settings& settings)
    : settings_(settings),
      command_(CommandLayout(settings.ranges)),
      reply_(ReplyLayout(settings.ranges, settings.reply_length)) {
  const auto positive = [](double range) { return range > 0 && std::isfinite(range); };
  const MitRanges& r = settings.ranges;
  if (settings.node < 1 || settings.node > 0xFF || settings.master < 0 || settings.master > 0x7FF ||
      settings.reply_length < kPlain || settings.reply_length > kWithTemperature ||
      !positive(r.position) || !positive(r.velocity) || !positive(r.torque) || !positive(r.kp) ||
      !positive(r.kd)) {
    throw std::invalid_argument(
        "a MIT motor needs an id in [1, 0xFF], replies of 6 to 8 bytes, and ranges");
  }
}

void MitDevice::OnFrame(const Frame& frame, int64_t now) noexcept {
  if (frame.extended || frame.error || frame.fd ||
      frame.id != static_cast<uint32_t>(settings_.node))
    return;
  if (frame.remote || frame.length != 8) {
    ++rejected_;
    return;
  }
  CheckWatchdog(now);
  if (due_count_ < due_.size()) due_[due_count_++] = armed_ ? setpoint_ : Setpoint{};
  if (std::all_of(frame.data.begin(), frame.data.begin() + 7,
                  [](uint8_t byte) { return byte == 0xFF; })) {
    switch (frame.data[7]) {
      case kEnter:
        if (error_ != kNoError) return;
        if (!armed_) fed_ = now;
        armed_ = true;
        return;
      case kExit:
        armed_ = false;
        return;
      case kZero:
        make_zero_ = !armed_;  // bgkatz: in rest mode only
        return;
      default:
        break;
    }
  }
  const FieldValues v = *DecodePayload(command_, frame);
  setpoint_ = {v[0], v[1], v[2], v[3], v[4]};
  fed_ = now;
}

void MitDevice::CheckWatchdog(int64_t now) noexcept {
  if (armed_ && settings_.watchdog > 0 && now - fed_ >= settings_.watchdog) {
    setpoint_.kp = setpoint_.kd = setpoint_.torque = 0;
  }
}

int64_t MitDevice::NextDue() const noexcept {
  const bool acts = setpoint_.kp != 0 || setpoint_.kd != 0 || setpoint_.torque != 0;
  return armed_ && acts && settings_.watchdog > 0 ? fed_ + settings_.watchdog
                                                  : std::numeric_limits<int64_t>::max();
}

double MitDevice::Torque(const Sample& sample) const noexcept {
  if (!armed_ || error_ != kNoError) return 0;
  const double torque = setpoint_.kp * (setpoint_.position - (sample.position - zero_)) +
                        setpoint_.kd * (setpoint_.velocity - sample.velocity) + setpoint_.torque;
  if (std::isnan(torque)) return 0;  // where a simulation has come apart
  return std::clamp(torque, -settings_.ranges.torque, settings_.ranges.torque);
}

void MitDevice::Reboot(double position) noexcept {
  armed_ = false;
  setpoint_ = {};
  zero_ = position;
  due_count_ = 0;
}

Frame MitDevice::Reply(const Sample& sample, double torque) const noexcept {
  const uint32_t position = Truncate(reply_.fields[1], sample.position - zero_);
  const uint32_t velocity = Truncate(reply_.fields[2], sample.velocity);
  const uint32_t current = Truncate(reply_.fields[3], torque);
  Frame frame;
  frame.id = static_cast<uint32_t>(settings_.master);
  frame.length = settings_.reply_length;
  frame.data[0] = static_cast<uint8_t>(settings_.node);
  frame.data[1] = static_cast<uint8_t>(position >> 8);
  frame.data[2] = static_cast<uint8_t>(position);
  frame.data[3] = static_cast<uint8_t>(velocity >> 4);
  frame.data[4] = static_cast<uint8_t>((velocity & 0xF) << 4 | current >> 8);
  frame.data[5] = static_cast<uint8_t>(current);
  if (frame.length == kWithVoltage) {
    frame.data[6] = static_cast<uint8_t>(std::clamp(settings_.bus_voltage / 40 * 255, 0., 255.));
  } else if (frame.length == kWithTemperature) {
    frame.data[6] =
        static_cast<uint8_t>(static_cast<int8_t>(std::clamp(settings_.temperature, -128., 127.)));
    frame.data[7] = error_;
  }
  return frame;
}

void MitDevice::Tick(int64_t now, const Sample& sample, FrameBatch& out) noexcept {
  CheckWatchdog(now);
  if (error_ != kNoError) armed_ = false;
  for (size_t i = 0; i < due_count_; ++i) {
    const Setpoint& s = due_[i];
    const double torque = s.kp * (s.position - (sample.position - zero_)) +
                          s.kd * (s.velocity - sample.velocity) + s.torque;
    out.Push(Reply(sample, torque));
  }
  due_count_ = 0;
  if (make_zero_) {
    zero_ = sample.position;
    ++zeroed_;
    make_zero_ = false;
  }
}

std::unique_ptr<MotorDevice> MakeMitDevice(const MotorDescription& motor, const DriverSettings&,
                                           const VirtualRobotSettings& settings) {
  if (!motor.mit) throw std::invalid_argument("a motor of protocol 'mit' needs its ranges");
  MitDevice::Settings own;
  own.node = motor.node;
  own.master = motor.mit->master;
  own.ranges = motor.mit->ranges;
  own.watchdog = Microseconds(settings.watchdog);
  return std::make_unique<Drive>(own);
}

}  // namespace plumb
