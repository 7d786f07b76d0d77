#include "drivers/protocols/rmd_device.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "common/time_units.h"

namespace plumb {
namespace {

using namespace rmd;

constexpr int64_t kWarning = 1'000'000;              // [us] between two kInterrupted
constexpr double kDegrees = 180 / std::numbers::pi;  // in a radian

// As C makes an integer of it, where it fits; of not-a-number 0.
double Cut(const Field& field, double value) {
  if (std::isnan(value)) return 0;
  return std::clamp(std::trunc(value / field.scale) * field.scale, field.lowest(), field.highest());
}

class Drive : public MotorDevice {
 public:
  explicit Drive(const RmdDevice::Settings& settings) : device_(settings) {}

  std::vector<Filter> filters() const override {
    const auto filters = device_.filters();
    return {filters.begin(), filters.end()};
  }
  bool OnFrame(const Frame& frame, int64_t now) override { return device_.OnFrame(frame, now); }
  void Tick(int64_t now, const ShaftReading& shaft, FrameBatch& out) override {
    constexpr double kTurn = 2 * std::numbers::pi;  // [rad]
    device_.Tick(now, {shaft.turns * kTurn, shaft.turns_per_second * kTurn}, out);
  }
  int64_t NextDue() const override { return device_.NextDue(); }
  double Torque() const override { return device_.Torque(); }
  void Boot(int64_t now) override { device_.Reboot(now, 0); }
  bool armed() const override { return device_.armed(); }
  int64_t rejected() const override { return device_.rejected(); }

 private:
  RmdDevice device_;
};

}  // namespace

RmdDevice::RmdDevice(const Settings& settings)
    : settings_(settings), watchdog_(settings.watchdog / 1000 * 1000) {
  const auto positive = [](double value) { return value > 0 && std::isfinite(value); };
  if (settings.node < 1 || settings.node > kMaxNode || !positive(settings.torque_constant) ||
      !positive(settings.current) || settings.watchdog < 0) {
    throw std::invalid_argument(
        "an RMD motor needs an id in [1, 32], a torque constant and a current");
  }
}

std::array<Filter, 2> RmdDevice::filters() const {
  return {Filter{.id = kCommands + static_cast<uint32_t>(settings_.node)},
          Filter{.id = kAllMotors}};
}

bool RmdDevice::OnFrame(const Frame& frame, int64_t now) noexcept {
  if (frame.extended || frame.error || frame.fd ||
      (frame.id != kCommands + static_cast<uint32_t>(settings_.node) && frame.id != kAllMotors)) {
    return false;
  }
  if (frame.remote || frame.length != 8) {
    ++rejected_;
    return false;
  }
  CheckWatchdog(now);
  fed_ = now;
  const bool echo = interrupted_;
  interrupted_ = false;
  if (!echo && !Obey(frame, now)) return false;
  if (due_count_ == due_.size()) return true;
  Answer& answer = due_[due_count_++];
  std::copy_n(frame.data.begin(), answer.command.size(), answer.command.begin());
  answer.echo = echo;
  return true;
}

// Whether it is answered.
bool RmdDevice::Obey(const Frame& frame, int64_t now) noexcept {
  switch (frame.data[0]) {
    case kTorqueControl:
      current_ = (*DecodePayload(kTorque, frame))[1];
      running_ = brake_released_ && errors_ == 0;
      return true;
    case kStop:
      current_ = 0;
      return true;
    case kShutdown:
      Shutdown();
      return true;
    case kLockBrake:
      Shutdown();
      brake_released_ = false;
      return true;
    case kReleaseBrake:
      brake_released_ = true;
      return true;
    case kSetWatchdog:
      watchdog_ = static_cast<int64_t>((*DecodePayload(kWatchdog, frame))[1]) * 1000;
      ++writes_;
      return true;
    case kAskAngle:
    case kAskStatus:
    case kAskMotion:
    case kAskUptime:
    case kAskVersion:
    case kAskModel:
      return true;
    case kReset:
      Reboot(now, zero_);
      return false;
    default:
      ++rejected_;
      return false;
  }
}

void RmdDevice::Shutdown() noexcept {
  running_ = false;
  current_ = 0;
}

void RmdDevice::CheckWatchdog(int64_t now) noexcept {
  if (watchdog_ == 0 || interrupted_ || now - fed_ < watchdog_) return;
  Shutdown();
  brake_released_ = false;
  interrupted_ = true;
  next_warning_ = now;
}

void RmdDevice::set_errors(uint16_t errors) noexcept {
  errors_ = errors;
  if (errors != 0) Shutdown();
}

void RmdDevice::Reboot(int64_t now, double position) noexcept {
  Shutdown();
  brake_released_ = interrupted_ = false;
  zero_ = position;
  booted_ = fed_ = now;
  due_count_ = 0;
}

int64_t RmdDevice::NextDue() const noexcept {
  if (watchdog_ == 0) return std::numeric_limits<int64_t>::max();
  return interrupted_ ? next_warning_ : fed_ + watchdog_;
}

double RmdDevice::Torque() const noexcept {
  if (!running_) return 0;
  return std::clamp(current_, -settings_.current, settings_.current) * settings_.torque_constant;
}

Frame RmdDevice::Reply(const Answer& answer, const Sample& sample, int64_t now) const noexcept {
  Frame frame;
  frame.id = kAnswers + static_cast<uint32_t>(settings_.node);
  frame.length = 8;
  std::copy(answer.command.begin(), answer.command.end(), frame.data.begin());
  if (answer.echo) return frame;
  const double degrees = (sample.position - zero_) * kDegrees, code = answer.command[0];
  switch (answer.command[0]) {
    case kTorqueControl:
    case kAskMotion: {
      const Layout& layout = answer.command[0] == kAskMotion ? kMotion : kTorqueAnswer;
      EncodePayload(
          layout,
          {code, settings_.temperature, Cut(layout.fields[2], Torque() / settings_.torque_constant),
           Cut(layout.fields[3], sample.velocity * kDegrees), Cut(layout.fields[4], degrees)},
          frame);
      return frame;
    }
    case kAskAngle:
      EncodePayload(kAngle, {code, Cut(kAngle.fields[1], degrees)}, frame);
      return frame;
    case kAskStatus:
      EncodePayload(kStatus,
                    {code, settings_.temperature, brake_released_ ? 1. : 0., settings_.bus_voltage,
                     static_cast<double>(errors_)},
                    frame);
      return frame;
    case kAskUptime:
      EncodePayload(kUptime,
                    {code, static_cast<double>(static_cast<uint32_t>((now - booted_) / 1000))},
                    frame);
      return frame;
    case kAskVersion:
      EncodePayload(kVersion, {code, 20220206}, frame);
      return frame;
    case kAskModel:
      std::copy_n("X8S2V10", 7, frame.data.begin() + 1);
      return frame;
    default:
      return frame;  // the command itself
  }
}

void RmdDevice::Tick(int64_t now, const Sample& sample, FrameBatch& out) noexcept {
  for (size_t i = 0; i < due_count_; ++i) out.Push(Reply(due_[i], sample, now));
  due_count_ = 0;
  CheckWatchdog(now);
  if (!interrupted_ || now < next_warning_) return;
  Frame warning;
  warning.id = kAnswers + static_cast<uint32_t>(settings_.node);
  warning.length = 8;
  warning.data[0] = kInterrupted;
  out.Push(warning);
  next_warning_ = now + kWarning;
}

std::unique_ptr<MotorDevice> MakeRmdDevice(const MotorDescription& motor, const DriverSettings&,
                                           const VirtualRobotSettings& settings) {
  if (!motor.rmd)
    throw std::invalid_argument("a motor of protocol 'rmd' needs its torque constant");
  return std::make_unique<Drive>(RmdDevice::Settings{
      .node = motor.node,
      .torque_constant = motor.rmd->torque_constant,
      .current = motor.rmd->current,
      .watchdog = Microseconds(settings.watchdog),
  });
}

}  // namespace plumb
