#pragma once

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "common/special_numbers.h"
#include "drivers/driver/driver.h"
#include "drivers/protocols/cansimple_device.h"

namespace plumb {

/// A driver and its virtual drives in virtual time: milliseconds pass one by one, the driver cycles
/// every five. Everything on the wire passes through the two taps, which may drop or change it.
struct Rig {
  static constexpr int64_t kEpoch = 1'700'000'000'000'000;  ///< utime - now

  explicit Rig(int joints = 1) {
    for (int i = 0; i < joints; ++i) {
      JointDescription joint;
      joint.name = i == 0 ? "pivot" : "knee" + std::to_string(i);
      joint.type = JointDescription::Type::kContinuous;
      joint.lower = -std::numeric_limits<double>::infinity();
      joint.upper = std::numeric_limits<double>::infinity();
      joint.effort_limit = 2;
      joint.velocity_limit = 20;
      joint.motor.protocol = "cansimple";
      joint.motor.node = i + 1;
      robot.joints.push_back(joint);
    }
    robot.driver = {.cycle = 0.005,
                    .measurement = 0.005,
                    .expiry = 0.1,
                    .disarm_after = 0.25,
                    .stale_after = 0.05,
                    .heartbeat_timeout = 0.5,
                    .start_guard = 0.25};
  }

  /// Begins: call after changing `robot` or `settings`.
  void Start() {
    driver = std::make_unique<Driver>(robot, now, utime());
    for (const JointDescription& joint : robot.joints) {
      settings.node = joint.motor.node;
      drives.emplace_back(settings, now);
    }
    samples.resize(drives.size());
  }

  int64_t utime() const { return kEpoch + now - set_back; }

  /// One millisecond.
  void Step() {
    now += 1000;
    if (on_step) on_step();
    for (size_t i = 0; i < drives.size(); ++i) {
      FrameBatch batch;
      drives[i].Tick(now, samples[i], batch);
      for (Frame frame : batch.frames()) {
        if (!to_driver || to_driver(frame)) driver->OnFrame(0, frame, now, utime());
      }
    }
    if (driver_stopped) return;
    while (const joint_state_t* state = driver->NextState()) states.push_back(*state);
    if (now % 5000 != cycle_phase) return;
    if (commanding) Command(effort);
    sent.clear();
    driver->Tick(now, utime(), lateness);
    for (const Frame& frame : driver->frames(0)) sent.push_back(frame);
    const int accepted = bus_full ? 0 : accept ? accept(sent) : static_cast<int>(sent.size());
    driver->Transmitted({&accepted, 1}, utime());
    for (int i = 0; i < accepted; ++i) {
      Frame frame = sent[static_cast<size_t>(i)];
      if (to_drive && !to_drive(frame)) continue;
      for (CanSimpleDevice& drive : drives) drive.OnFrame(frame, now);
    }
  }
  void Run(int64_t milliseconds) {
    for (int64_t i = 0; i < milliseconds; ++i) Step();
  }
  /// Until the driver is in the state. @return milliseconds it took, or -1 if more than the limit.
  int64_t RunUntil(DriveState state, int64_t limit = 3000) {
    for (int64_t i = 0; i <= limit; ++i) {
      if (driver->state() == state) return i;
      Step();
    }
    return -1;
  }

  void Inject(const std::string& text) { driver->OnFrame(0, *FrameFromText(text), now, utime()); }

  joint_command_t MakeCommand(double value) {
    joint_command_t command{};
    const size_t size = drives.size();
    command.utime = utime();
    command.sequence = ++sequence;
    command.state_sequence = 0;
    command.episode = episode;
    command.step = -1;
    command.policy_iteration = -1;
    command.num_joints = static_cast<int32_t>(size);
    command.expiry = 0;
    command.effort.assign(size, value);
    for (auto* values : {&command.position, &command.velocity, &command.kp, &command.kd})
      values->assign(size, kNaN);
    return command;
  }
  void Command(double value) { driver->OnCommand(MakeCommand(value), now, utime()); }
  void Request(int8_t what, int64_t made_before = 0) {
    driver_request_t request{};
    request.utime = utime() - made_before;
    request.request = what;
    driver->OnRequest(request, now, utime());
  }

  /// Past the start guard and armed, with a controller that commands `value` in every cycle.
  bool Arm(double value = 0, int8_t request = driver_request_t::ARM) {
    Run(300);
    Request(request);
    commanding = true;
    effort = value;
    return RunUntil(DriveState::kArmed) >= 0;
  }

  std::string Reason() const { return std::string(driver->reason()); }
  const driver_status_t& Status() { return driver->Status(utime(), {&stats, 1}, 0); }
  /// Texts of the frames sent in the last cycle.
  std::vector<std::string> Sent() const {
    std::vector<std::string> texts;
    for (const Frame& frame : sent) texts.push_back(ToText(frame));
    return texts;
  }

  RobotDescription robot{};
  CanSimpleDevice::Settings settings = {
      .heartbeat_period = 20'000, .encoder_period = 5'000, .watchdog = 100'000};
  std::unique_ptr<Driver> driver;
  std::vector<CanSimpleDevice> drives;
  std::vector<CanSimpleDevice::Sample> samples;
  std::vector<joint_state_t> states;
  std::vector<Frame> sent;
  TransportStats stats;
  std::function<void()> on_step;
  std::function<bool(Frame&)> to_driver, to_drive;
  std::function<int(const std::vector<Frame>&)>
      accept;  ///< how many frames the transport takes; default: all
  int64_t now = 5'000'000;
  int64_t set_back = 0;     ///< [us] by which the real-time clock was set back
  int64_t cycle_phase = 0;  ///< [us] of the driver's cycle behind the drives' samples
  int64_t lateness = 0;
  int64_t sequence = 0;
  bool commanding = false;
  bool bus_full = false;
  bool driver_stopped = false;  ///< its process has been stopped: it hears, says and does nothing
  double effort = 0;
  int64_t episode = -1;
};

}  // namespace plumb
