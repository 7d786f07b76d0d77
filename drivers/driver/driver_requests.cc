// Of driver.h: the messages that it receives: DRIVER_REQUEST and JOINT_COMMAND.

#include "drivers/driver/driver.h"
#include "drivers/driver/operating_limits.h"

namespace plumb {
namespace {

// [us] that the clock of a request's maker may be ahead of ours
constexpr int64_t kClockError = 1'000'000;

}  // namespace

void Driver::OnRequest(const driver_request_t& request, int64_t now, int64_t utime) noexcept {
  SetTime(now, utime);
  StampStopTime();
  Answer(request);
  switch (request.request) {
    case driver_request_t::ARM:
      return RequestArm(request.utime, false);
    case driver_request_t::ARM_HOMED:
      return RequestArm(request.utime, true);
    // Stopping is obeyed whatever the request's time.
    case driver_request_t::DISARM:
      status_.stopped_by_request = true;
      return Stop("disarmed on request");
    case driver_request_t::ESTOP:
      return Estop("emergency stop requested");
    default:
      ++requests_rejected_;
      return;
  }
}

void Driver::End(std::string_view why, int64_t now, int64_t utime) noexcept {
  SetTime(now, utime);
  StampStopTime();
  ending_ = true;
  if (status_.stopped_by_request) return;  // whoever has stopped us stays the one who did
  Reason ends;
  ends.Set("the driver ends: {}", why);
  Stop(ends.text());
}

/// What a fault has stopped already keeps the fault's reason.
void Driver::Stop(std::string_view why) noexcept {
  if (mode_ == Mode::kFault) {
    stopped_utime_ = utime_;
    return;
  }
  cause_.Set("{}", why);
  reason_ = cause_;
  Disarm();
}

/// With the next status, which tells of its effect.
void Driver::Answer(const driver_request_t& request) noexcept {
  if (request.identity == 0) return;
  status_.answered = request.identity;
  ++revision_;
}

void Driver::Estop(std::string_view reason) noexcept {
  status_.stopped_by_request = true;
  Fault("{}", reason);
  stopped_utime_ = utime_;
  for (Joint& joint : joints_) joint.motor->Estop(now_);
}

void Driver::Refuse(std::string_view why) noexcept {
  ++arms_refused_;
  Reason count;
  if (arms_refused_ > 1) count.Set(" ({} times)", arms_refused_);
  // The cause of the stop is worth more than that of the refusal.
  const std::string_view cause = cause_.text();
  reason_.Set("{}{}ARM refused{}: {}", cause, cause.empty() ? "" : "; ", count.text(), why);
}

void Driver::RequestArm(int64_t made, bool homed) noexcept {
  if (Active()) return;  // obeyed already
  const int64_t now = now_;
  if (ending_) return Refuse("the driver ends");
  // Of another run, or from before whatever stopped us, or one that was obeyed already (its maker's
  // clock may be ahead of ours, so that it looks newer than the stop). One from further ahead would
  // make all void that come after it.
  if (made > utime_ + kClockError)
    return Refuse("it is dated in the future: are the clocks the same?");
  if (made < start_utime_) return Refuse("it was made before the driver started");
  if (made <= stopped_utime_) return Refuse("it was made before the driver stopped");
  if (made <= armed_by_) return Refuse("it, or a newer one, was obeyed already");
  if (now - start_now_ < start_guard_) return Refuse("the driver has only just started");
  if (stray_controller_ && now - last_command_ < start_guard_) {
    return Refuse(
        "commands arrived when the driver started: stop the controller of an earlier run");
  }
  if (replay_) return Refuse("the bus is a recording: nobody hears us");
  for (const Bus& bus : buses_) {
    const std::string_view wrong =
        now - bus.foreign_at < start_guard_
            ? "somebody else commands the drives: there is a second master on the bus"
        : bus.link != LinkState::kUp ? "the CAN interface is not up"
        : bus.off                    ? "the CAN controller is bus-off"
                                     : "";
    if (wrong.empty()) continue;
    Reason why;
    why.Set("{}{}", bus.prefix, wrong);
    return Refuse(why.text());
  }
  for (Joint& joint : joints_) {
    Reason why;
    if (joint.motor->state() == DriveState::kAbsent) {
      why.Set("{}: {}", joint.name, joint.motor->reason());
    } else if (!joint.measured || now - joint.measured_at > stale_after_) {
      why.Set("{}: no encoder estimates{}", joint.name, joint.WhatComes());
    } else if (joint.watch.crowded()) {
      why.Set(
          "{}: more encoder estimates than one drive is to send: does it send them more often than "
          "[driver] measurement says, or have two drives one id?",
          joint.name);
    } else if (Reason bad; !WithinOperatingLimits(joint.motor->readings(), settings_, bad)) {
      why.Set("{}: {}", joint.name, bad.text());
    }
    if (!homed && (joint.motor->lost_place() || joint.watch.lost_place()))
      why.Set(
          "{}: {}: home the joint, then plumb arm --homed", joint.name,
          joint.motor->lost_place() ? "its drive has lost its place" : "its position has jumped");
    if (!why.text().empty()) return Refuse(why.text());
  }
  for (JointSensor& sensor : sensors_) {
    if (sensor.fresh(now)) continue;
    Reason why;
    why.Set("{}: {}", sensor.name(), sensor.Silent(now).text());
    // Arming is a person's word that what was wrong is right again.
    if (sensor.device().state() == SensorState::kFault) sensor.device().Start(now);
    return Refuse(why.text());
  }
  for (const SecondEncoder& second : second_encoders_) {
    if (Reason why; !Agree(second, why)) return Refuse(why.text());
  }
  armed_by_ = made;
  arms_refused_ = 0;
  stray_controller_ = false;
  status_.stopped_by_request = false;
  for (Bus& bus : buses_) bus.refused_cycles = 0;
  inbox_.Clear();
  forgery_ = {};
  cause_.Clear();
  for (Joint& joint : joints_) {
    if (homed) joint.motor->Homed(), joint.watch.Homed();
    joint.motor->Arm(now);
    joint.watch.ClearComplaint();
    joint.commanded = 0;
  }
  mode_ = Mode::kArming;
  reason_.Set("arming");
  for (const Joint& joint : joints_) {
    if (!joint.position_watch.beyond()) continue;
    reason_.Set("arming, although {} is {}", joint.name, joint.position_watch.Warning().text());
    break;
  }
}

// Neither is taken for a sign of a controller: a forger could keep the robot from being armed. Nor
// is a forged request answered: genuine ones would not find their answers among them.
void Driver::OnForgedArm(std::string_view why) noexcept {
  ++status_.commands_forged;
  if (!Active()) Refuse(why);
}

void Driver::OnForgedCommand(std::string_view why) noexcept {
  ++status_.commands_forged;
  forgery_ = why;
}

void Driver::OnCommand(const joint_command_t& command, int64_t now, int64_t utime) noexcept {
  SetTime(now, utime);
  last_command_ = now;
  forgery_ = {};
  if (now - start_now_ < start_guard_) {
    stray_controller_ = true;
    ++status_.commands_rejected;
    return;
  }
  if (mode_ != Mode::kArmed) return;
  if (inbox_.Offer(command, now, utime)) {
    ++status_.commands_accepted;
    expiry_counted_ = false;
  } else {
    ++status_.commands_rejected;
  }
}

}  // namespace plumb
