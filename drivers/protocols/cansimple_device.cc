#include "drivers/protocols/cansimple_device.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "common/time_units.h"

namespace plumb {
namespace {

using namespace cansimple;

constexpr int64_t kNever = std::numeric_limits<int64_t>::max();

/// The first multiple of the period after `now`.
int64_t NextMultiple(int64_t period, int64_t now) {
  if (period <= 0) return kNever;
  const int64_t remainder = (now % period + period) % period;
  return now - remainder + period;
}

class Drive : public MotorDevice {
 public:
  explicit Drive(const CanSimpleDevice::Settings& settings)
      : settings_(settings), device_(settings, 0) {}

  std::vector<Filter> filters() const override {
    const auto filters = device_.filters();
    return {filters.begin(), filters.end()};
  }
  bool OnFrame(const Frame& frame, int64_t now) override {
    const double before = Torque();
    device_.OnFrame(frame, now);
    // May be a request: its answer is of the shaft as it is now.
    return frame.remote || frame.length == 0 || Torque() != before;
  }
  void Tick(int64_t now, const ShaftReading& shaft, FrameBatch& out) override {
    device_.Tick(now, {shaft.turns, shaft.turns_per_second}, out);
  }
  int64_t NextDue() const override { return device_.NextDue(); }
  double Torque() const override { return device_.Torque(); }
  void Boot(int64_t now) override { device_ = CanSimpleDevice(settings_, now); }
  bool armed() const override { return device_.armed(); }
  uint32_t disarm_reason() const override { return device_.disarm_reason(); }
  int64_t rejected() const override { return device_.rejected(); }

 private:
  CanSimpleDevice::Settings settings_;
  CanSimpleDevice device_;
};

}  // namespace

CanSimpleDevice::CanSimpleDevice(const Settings& settings, int64_t now)
    : settings_(settings),
      fed_(now),
      next_heartbeat_(NextMultiple(settings.heartbeat_period, now)),
      next_encoder_(NextMultiple(settings.encoder_period, now)),
      next_torques_(NextMultiple(settings.torques_period, now)),
      next_telemetry_(NextMultiple(settings.telemetry_period, now)) {
  if (settings.node < 0 || settings.node > kMaxNode || settings.heartbeat_period <= 0) {
    throw std::invalid_argument("a CANSimple drive needs a node in [0, 0x3E] and a heartbeat");
  }
}

std::array<Filter, 2> CanSimpleDevice::filters() const {
  return {{{.id = static_cast<uint32_t>(settings_.node) << 5, .mask = 0x7E0, .remote = true},
           {.id = static_cast<uint32_t>(kBroadcastNode) << 5, .mask = 0x7E0, .remote = true}}};
}

void CanSimpleDevice::OnFrame(const Frame& frame, int64_t now) noexcept {
  const auto node = static_cast<int>(frame.id >> 5);
  const auto command = static_cast<uint8_t>(frame.id & 0x1F);
  if (frame.extended || frame.error || frame.fd) return;
  if (node == kBroadcastNode) {
    if (command == kEstop.command && !frame.remote) FallIdle(kEstopRequested);
    if (command == kAddress.command && frame.remote) requested_ |= 1u << command;
    return;
  }
  if (node != settings_.node) return;
  CheckWatchdog(now);  // a setpoint that comes too late must not count
  switch (command) {
    case kGetVersion.command:
    case kHeartbeat.command:
    case kGetError.command:
    case kGetEncoderEstimates.command:
    case kGetIq.command:
    case kGetTemperature.command:
    case kGetBusVoltageCurrent.command:
    case kGetTorques.command:
      // A request is a remote frame, or one without data.
      if (frame.remote || frame.length == 0) {
        requested_ |= 1u << command;
      } else {
        ++rejected_;
      }
      return;
    default:
      break;
  }
  if (frame.remote) {
    ++rejected_;
    return;
  }
  switch (command) {
    case kEstop.command:
      return FallIdle(kEstopRequested);
    case kSetAxisState.command:
      if (const auto values = DecodePayload(kSetAxisState, frame)) {
        return RequestState(static_cast<int>(std::min((*values)[0], 255.0)), now);
      }
      break;
    case kSetControllerMode.command:
      if (const auto values = DecodePayload(kSetControllerMode, frame)) {
        control_mode_ = static_cast<int>(std::min((*values)[0], 255.0));
        input_mode_ = static_cast<int>(std::min((*values)[1], 255.0));
        return;
      }
      break;
    case kSetInputPos.command:
      return OnSetpoint(kSetInputPos, 2, frame, now);
    case kSetInputVel.command:
      return OnSetpoint(kSetInputVel, 1, frame, now);
    case kSetInputTorque.command:
      return OnSetpoint(kSetInputTorque, 0, frame, now);
    case kClearErrors.command:
      if (DecodePayload(kClearErrors, frame)) {
        active_errors_ = disarm_reason_ = 0;
        procedure_result_ = kSuccess;
        return;
      }
      break;
    default:
      break;
  }
  ++rejected_;
}

void CanSimpleDevice::OnSetpoint(const Layout& layout, size_t torque, const Frame& frame,
                                 int64_t now) noexcept {
  const auto values = DecodePayload(layout, frame);
  if (!values || !AllFinite(layout, *values)) {
    ++rejected_;
    return;
  }
  fed_ = now;
  active_errors_ &= ~kWatchdogTimerExpired;  // the cause is gone; the disarm reason stays
  setpoint_ = (*values)[torque];
  ++setpoints_;
}

void CanSimpleDevice::RequestState(int state, int64_t now) noexcept {
  if (state == kIdle) {
    state_ = kIdle;
    procedure_result_ = kSuccess;
    return;
  }
  if (state != kClosedLoopControl) {
    procedure_result_ = kInvalidState;
    return;
  }
  if (armed()) return;
  if ((active_errors_ | disarm_reason_) != 0) {
    procedure_result_ = kDisarmed;
    return;
  }
  state_ = kClosedLoopControl;
  procedure_result_ = kSuccess;
  setpoint_ = 0;  // whatever was set while idle is forgotten
  CheckWatchdog(now);
}

void CanSimpleDevice::FallIdle(uint32_t reason) noexcept {
  active_errors_ |= reason & kWatchdogTimerExpired;
  if (armed()) procedure_result_ = kDisarmed;
  disarm_reason_ |= reason;
  state_ = kIdle;
  setpoint_ = 0;
}

void CanSimpleDevice::Reboot(int64_t now) noexcept {
  state_ = kIdle;
  control_mode_ = kPositionControl;
  input_mode_ = kPassthrough;
  procedure_result_ = kSuccess;
  active_errors_ = disarm_reason_ = 0;
  setpoint_ = 0;
  fed_ = now;
  requested_ = 0;
}

void CanSimpleDevice::CheckWatchdog(int64_t now) noexcept {
  if (armed() && settings_.watchdog > 0 && now - fed_ >= settings_.watchdog)
    FallIdle(kWatchdogTimerExpired);
}

double CanSimpleDevice::Torque() const noexcept {
  return armed() && control_mode_ == kTorqueControl && input_mode_ == kPassthrough ? setpoint_ : 0;
}

int64_t CanSimpleDevice::NextDue() const noexcept {
  int64_t due = std::min({next_heartbeat_, next_encoder_, next_torques_, next_telemetry_});
  if (armed() && settings_.watchdog > 0) due = std::min(due, fed_ + settings_.watchdog);
  return due;
}

Frame CanSimpleDevice::Report(uint8_t command, const Sample& sample) const noexcept {
  const int node = settings_.node;
  const double torque = Torque();
  switch (command) {
    case kGetVersion.command: {
      const auto& v = settings_.version;
      return Make(kGetVersion, node,
                  {double(v[0]), double(v[1]), double(v[2]), double(v[3]), double(v[4]),
                   double(v[5]), double(v[6]), double(v[7])});
    }
    case kHeartbeat.command:
      return Make(
          kHeartbeat, node,
          {double(active_errors_ | disarm_reason_), double(state_), double(procedure_result_)});
    case kGetError.command:
      return Make(kGetError, node, {double(active_errors_), double(disarm_reason_)});
    case kAddress.command:
      return Make(kAddress, kBroadcastNode, {double(node), double(settings_.serial_number)});
    case kGetEncoderEstimates.command:
      return Make(kGetEncoderEstimates, node, {sample.position, sample.velocity});
    case kGetIq.command:
      return Make(kGetIq, node,
                  {torque / settings_.torque_constant, torque / settings_.torque_constant});
    case kGetTemperature.command:
      return Make(kGetTemperature, node, {settings_.temperature, settings_.temperature});
    case kGetBusVoltageCurrent.command:
      return Make(kGetBusVoltageCurrent, node, {settings_.bus_voltage, 0});
    default:
      return Make(kGetTorques, node, {torque, torque});
  }
}

void CanSimpleDevice::Tick(int64_t now, const Sample& sample, FrameBatch& out) noexcept {
  CheckWatchdog(now);
  const auto due = [now](int64_t& next, int64_t period) {
    if (now < next) return false;
    next = NextMultiple(period, now);
    return true;
  };
  if (due(next_encoder_, settings_.encoder_period))
    requested_ |= 1u << kGetEncoderEstimates.command;
  if (due(next_torques_, settings_.torques_period)) requested_ |= 1u << kGetTorques.command;
  if (due(next_telemetry_, settings_.telemetry_period)) {
    requested_ |= 1u << kGetTemperature.command | 1u << kGetBusVoltageCurrent.command;
  }
  if (due(next_heartbeat_, settings_.heartbeat_period)) requested_ |= 1u << kHeartbeat.command;
  // The sample goes first: it is what the host is waiting for.
  constexpr uint8_t kFirst = kGetEncoderEstimates.command;
  if (requested_ & 1u << kFirst) out.Push(Report(kFirst, sample));
  requested_ &= ~(1u << kFirst);
  for (uint8_t command = 0; requested_ != 0; ++command) {
    if (requested_ & 1u << command) out.Push(Report(command, sample));
    requested_ &= ~(1u << command);
  }
}

std::unique_ptr<MotorDevice> MakeCanSimpleDevice(const MotorDescription& motor,
                                                 const DriverSettings& driver,
                                                 const VirtualRobotSettings& settings) {
  return std::make_unique<Drive>(CanSimpleDevice::Settings{
      .node = motor.node,
      .heartbeat_period = Microseconds(settings.heartbeat),
      .encoder_period = Microseconds(driver.measurement),
      .watchdog = Microseconds(settings.watchdog),
      .serial_number = static_cast<uint64_t>(motor.node),
  });
}

}  // namespace plumb
