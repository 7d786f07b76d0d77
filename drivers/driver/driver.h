#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "drivers/can/error_frame.h"
#include "drivers/can/transport.h"
#include "drivers/driver/command_inbox.h"
#include "drivers/driver/effort_history.h"
#include "drivers/driver/joint_map.h"
#include "drivers/driver/joint_sensor.h"
#include "drivers/driver/measurements.h"
#include "drivers/driver/plausibility.h"
#include "drivers/driver/position_watch.h"
#include "drivers/protocols/motor.h"
#include "plumb/driver_request_t.hpp"
#include "plumb/driver_status_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "plumb/joint_state_t.hpp"
#include "robot/description.h"
#include "robot/limit_effort.h"

namespace plumb {

/// The driver without sockets and clock: frames and messages go in, frames and messages come out.
/// One cycle:
///
///     for (frame received on bus) driver.OnFrame(bus, frame, now, utime of its arrival);
///     while (const joint_state_t* state = driver.NextState()) publish(*state);
///     while (const imu_t* imu = driver.NextImu()) publish(*imu);
///     driver.OnLink(...); driver.OnRequest(...); driver.OnCommand(...);   // what came since
///     driver.Tick(now, utime, lateness);                                  // once per cycle
///     for (bus) accepted[bus] = transport[bus].Send(driver.frames(bus));
///     driver.Transmitted(accepted, utime right after it);
///     // after every Tick: what was not accepted is given again
///
/// A robot may have several buses, by their indices in RobotDescription::buses; they have one cycle
/// and one state: what is wrong on one of them stops the joints on all.
///
/// It arms only on a request, made after its start and after whatever stopped it last. Armed, it
/// transmits a torque in every cycle, within the joint's limits: zero when the command has expired,
/// or what DriverSettings::stop says. It disarms and remembers why (FAULT) when commands stay away,
/// a measurement or heartbeat is missing or cannot be true, a drive or sensor reports an error, a
/// drive falls idle, is too hot or has a bad supply, a bus fails, or somebody else sends what
/// only it may send; only a new ARM leads out of FAULT.
///
/// `now` is scaled monotonic, `utime` scaled real time, both in microseconds. No method but the
/// constructor allocates (Status: when a text grows), blocks or throws. Not thread-safe.
class Driver {
 public:
  /// @param now, utime time of the start.
  /// @throws std::invalid_argument for an unknown protocol, a joint that nothing measures, or a bus
  /// that cannot work: ids in common, more than it carries (see BusPlan).
  Driver(const RobotDescription& robot, int64_t now, int64_t utime);

  size_t num_buses() const { return buses_.size(); }
  /// Filters that let in what a bus's drives and sensors send, and what only we may send, should
  /// another do so.
  std::vector<Filter> filters(size_t bus) const;
  int64_t cycle() const { return cycle_; }  ///< [us] period in which Tick wants to be called

  void OnFrame(size_t bus, const Frame& frame, int64_t now, int64_t utime) noexcept;
  /// The next JOINT_STATE, null if there is none; valid until the next call.
  const joint_state_t* NextState() noexcept;
  /// The next IMU reading, null if there is none; valid until the next call.
  const imu_t* NextImu() noexcept;
  void OnLink(size_t bus, LinkState link) noexcept;
  void OnRequest(const driver_request_t& request, int64_t now, int64_t utime) noexcept;
  /// The process ends, and nobody has asked for the motors to stop: as DISARM, but for who did it
  /// and why. Nothing arms from then on.
  void End(std::string_view why, int64_t now, int64_t utime) noexcept;
  void OnCommand(const joint_command_t& command, int64_t now, int64_t utime) noexcept;
  /// Instead of the two above, what is not to be obeyed because of who said it. @param why
  /// a literal.
  void OnForgedArm(std::string_view why) noexcept;
  void OnForgedCommand(std::string_view why) noexcept;
  /// @param lateness [us] after the cycle's deadline.
  void Tick(int64_t now, int64_t utime, int64_t lateness) noexcept;
  /// What to send on a bus after a Tick, torques first; valid until the next one.
  std::span<const Frame> frames(size_t bus) const noexcept { return buses_[bus].frames.frames(); }
  /// @param accepted how many of its frames each bus's transport took. @param utime when.
  void Transmitted(std::span<const int> accepted, int64_t utime) noexcept;

  DriveState state() const noexcept;
  /// Why it is not armed; empty when it is.
  std::string_view reason() const noexcept { return reason_.text(); }
  /// True once every drive that is there has confirmed that it is idle.
  bool confirmed_idle() const noexcept;
  /// Changes whenever a state or reason changes.
  uint64_t revision() const noexcept { return revision_; }
  int64_t faults() const noexcept { return faults_; }  ///< that it has fallen into so far
  /// The message to publish, to which the caller may add what only it knows; valid until the next
  /// call.
  /// @param stats of each bus's transport; empty: there are none.
  /// @param messages_rejected LCM messages that did not decode.
  driver_status_t& Status(int64_t utime, std::span<const TransportStats> stats,
                          int64_t messages_rejected);
  /// Whether signatures are looked at before OnRequest and OnCommand are called.
  void set_commands_signed(bool commands_signed) { status_.commands_signed = commands_signed; }
  /// The robot is a virtual one, which may be put elsewhere at once (PLACE_ROBOT) between episodes,
  /// while no effort is sent: every check of its motion then begins anew, as after switching on.
  void set_virtual(bool is_virtual) { virtual_ = is_virtual; }
  /// A bus is a recording: the driver refuses to arm.
  void set_replay(bool replay) { replay_ = replay; }

 private:
  enum class Mode { kRest, kArming, kArmed, kFault };
  /// A joint with a motor.
  struct Joint {
    Joint(size_t number, const JointDescription& joint, const DriverSettings& settings);
    size_t index;  // in the robot's joints
    std::string name;
    std::unique_ptr<Motor> motor;
    JointMap map;
    JointLimits limits;
    double damping;  // [Nm s/rad] or [N s/m] of a stop
    bool turns;      // does not slide
    Plausibility watch;
    PositionWatch position_watch;
    bool measured = false;
    int64_t measured_at = 0;    // `now` of the last estimate
    bool not_a_number = false;  // what came last in the place of an estimate
    /// Behind "no encoder estimate": what comes instead.
    std::string_view WhatComes() const noexcept {
      return not_a_number ? ": what came last is not a number" : "";
    }
    JointMeasurement latest;
    size_t bus;
    double effort = 0;      // in the torque frame of this cycle
    double commanded = 0;   // the same when the command was fresh last, until fresh_until_
    size_t torque_at = 0;   // that frame's place among the bus's frames
    size_t frames_end = 0;  // the motor's own frames of this cycle are before this one
  };
  struct Bus {
    std::string prefix;  // of reasons: "bus left: "; empty where it has no name
    bool usable() const noexcept { return link == LinkState::kUp && !off; }

    LinkState link = LinkState::kUp;
    bool off = false;        // its controller is bus-off
    int64_t foreign_at;      // `now` of the last frame that only we may send, and another has sent
    int unacknowledged = 0;  // error frames in a row that say so
    int refused_cycles = 0;
    int64_t received = 0, rejected = 0;  // frames
    std::vector<Filter> own;             // of the frames that only we may send

    FrameBatch frames;               // of this cycle
    size_t torque_frames = 0;        // the first of them
    size_t arming_room = 0;          // frames that arming may still take in this cycle
    int64_t poll_period, next_poll;  // [us] one question to one drive
    size_t poll_turn = 0;
  };

  template <class... Args>
  void Fault(fmt::format_string<Args...> format, Args&&... args) noexcept {
    if (mode_ == Mode::kFault) return;  // the first reason is the cause
    cause_.Set(format, std::forward<Args>(args)...);
    reason_ = cause_;
    Disarm();
    mode_ = Mode::kFault;
    ++faults_;
  }
  static std::vector<Joint> DrivenJoints(const RobotDescription& robot);
  /// @throws std::invalid_argument if one cannot work.
  std::vector<Bus> Buses(const RobotDescription& robot) const;
  /// Which sensors measure the joints without a motor. @throws std::invalid_argument if nothing
  /// measures one.
  void FindPassiveSensors(const RobotDescription& robot);
  void FindSecondEncoders(const RobotDescription& robot);
  bool DispatchToMotors(size_t bus, const Frame& frame, int64_t now, int64_t utime) noexcept;
  bool DispatchToSensors(size_t bus, const Frame& frame, int64_t now, int64_t utime) noexcept;
  void Refuse(std::string_view why) noexcept;
  void Stop(std::string_view why) noexcept;
  void Disarm() noexcept;
  void Answer(const driver_request_t& request) noexcept;
  void Estop(std::string_view reason) noexcept;
  void StampStopTime() noexcept;
  void SetTime(int64_t now, int64_t utime) noexcept;
  void RequestArm(int64_t made, bool homed) noexcept;
  void CheckHealth() noexcept;
  void CheckCommand() noexcept;
  struct SecondEncoder;
  /// @param why is set if not.
  bool Agree(const SecondEncoder& second, Reason& why) const noexcept;
  void CommandTorques() noexcept;
  /// Whether the robot may be put elsewhere at this time; a real one never is.
  bool MayBeDisplaced() const noexcept;
  void Displaced() noexcept;
  void Poll() noexcept;
  void PrepareMessages();
  void NoteLateness(int64_t lateness) noexcept;
  void NoteChanges() noexcept;
  void LookAtPositions() noexcept;
  /// Whether an armed drive does not report its temperatures any more.
  bool Unwatched(const Joint& joint) const noexcept;
  /// What is no fault, but not right either; empty: nothing.
  Reason Warning(const Joint& joint) const noexcept;
  bool Active() const noexcept { return mode_ == Mode::kArming || mode_ == Mode::kArmed; }

  const DriverSettings settings_;
  const int64_t cycle_, measurement_, disarm_after_, stale_after_, start_guard_, effort_delay_;
  const int64_t start_now_;
  const size_t num_joints_;  // of the robot
  std::vector<std::string> names_;
  std::vector<Joint> joints_;  // with a motor
  std::vector<JointSensor> sensors_;
  std::vector<Bus> buses_;
  /// Which sensor measures a joint without a motor.
  struct Measuring {
    size_t joint, sensor;
    PositionWatch position_watch;
  };
  std::vector<Measuring> passive_;
  /// An encoder on a joint whose motor measures it, too.
  struct SecondEncoder {
    size_t joint, sensor;  // indices into joints_, sensors_
    double tolerance;      // [rad] or [m]
  };
  std::vector<SecondEncoder> second_encoders_;
  Measurements measurements_;
  CommandInbox inbox_;
  EffortHistory history_;

  Reason reason_;
  // what stopped it: a fault or a request; the beginning of the reason
  Reason cause_;
  Mode mode_ = Mode::kRest;
  bool ending_ = false;
  int arms_refused_ = 0;  // since it was armed last
  int64_t now_, utime_;   // latest times given
  int64_t clock_offset_;  // utime - now, as long as nobody sets the clock
  int64_t start_utime_;
  int64_t stopped_utime_;     // of the last disarming; older ARM requests are void
  int64_t armed_by_;          // utime of the last ARM request that was obeyed
  int64_t armed_at_ = 0;      // `now`
  int64_t last_command_ = 0;  // `now` of any command, valid or not
  int64_t fresh_until_ = 0;   // [us] since when there is no command to obey
  // of a literal: what was wrong with a command since the last genuine one
  std::string_view forgery_;
  bool stop_stamped_ = true;       // false: stopped_utime_ is the last time known before it
  bool stray_controller_ = false;  // commanded during the start guard
  bool expiry_counted_ = false;
  bool replay_ = false;
  bool virtual_ = false;
  int64_t displaced_at_ = std::numeric_limits<int64_t>::min();  // `now` of the last Displaced()
  size_t turn_ = 0;                                             // whose own frames come first
  std::vector<double> effort_sent_;
  std::vector<JointMeasurement> scratch_;
  joint_state_t state_message_;
  int64_t previous_utime_ = 0;
  bool has_previous_ = false;
  driver_status_t status_;
  int64_t requests_rejected_ = 0;
  uint64_t revision_ = 0;
  int64_t faults_ = 0;
  uint64_t signature_ = 0;
};

}  // namespace plumb
