#include "drivers/driver/driver.h"

#include <algorithm>
#include <cstdlib>

#include "drivers/driver/stop.h"

namespace plumb {
namespace {

constexpr int kRefusedCycles = 10;  // consecutive cycles whose frames were not accepted
// in a cycle while arming: the kernel holds about ten in flight
constexpr size_t kMaxFrames = 8;
constexpr int64_t kClockSet = 10'000;  // [us] of real against monotonic time: not by itself
constexpr int kUnacknowledged = 16;    // consecutive no-acknowledge error frames: nobody is there

// By division, so that whole cycles sum up to the settings' seconds: a ramp ends at zero.
double InSeconds(int64_t microseconds) { return static_cast<double>(microseconds) / 1e6; }

}  // namespace

void Driver::Disarm() noexcept {
  stopped_utime_ = utime_;
  stop_stamped_ = false;
  inbox_.Clear();
  for (Joint& joint : joints_) {
    // One that has failed is being disarmed already, and remembers why.
    if (joint.motor->state() != DriveState::kFault) joint.motor->Disarm(now_);
  }
  mode_ = Mode::kRest;
}

/// A frame, or the link, stops us without saying what time it is, and the last time we were told is
/// long ago where our process stood still: an ARM that was made meanwhile is older than the stop.
void Driver::StampStopTime() noexcept {
  if (!stop_stamped_) stopped_utime_ = utime_;
  stop_stamped_ = true;
}

/// Where somebody has set the clock, what has been dated is as long ago as it was before: a clock
/// that is set right would else make void what people ask for until it has caught up.
void Driver::SetTime(int64_t now, int64_t utime) noexcept {
  const int64_t set_by = utime - now - clock_offset_;
  if (std::abs(set_by) > kClockSet) {
    for (int64_t* date : {&start_utime_, &stopped_utime_, &armed_by_}) *date += set_by;
    clock_offset_ += set_by;
  }
  now_ = now;
  utime_ = utime;
}

void Driver::OnFrame(size_t bus_index, const Frame& frame, int64_t now, int64_t utime) noexcept {
  Bus& bus = buses_[bus_index];
  now_ = now;
  ++bus.received;
  switch (DecodeErrorFrame(frame)) {
    case BusEvent::kBusOff:
      bus.off = true;
      if (Active()) Fault("{}the CAN controller went bus-off", bus.prefix);
      return;
    case BusEvent::kRestarted:
      bus.off = false;
      return;
    case BusEvent::kNoAck:
      if (++bus.unacknowledged > kUnacknowledged && Active())
        Fault("{}nobody on the bus acknowledges frames", bus.prefix);
      return;
    case BusEvent::kNone:
      break;
  }
  if (frame.error) return;
  if (frame.foreign) {
    bus.foreign_at = now;
    // A button on a bus is obeyed by all drives, whomever it was for.
    if (std::ranges::any_of(joints_, [&](const Joint& joint) {
          return joint.bus == bus_index && joint.motor->IsEstop(frame);
        })) {
      Reason why;
      why.Set("{}emergency stop from the bus", bus.prefix);
      return Estop(why.text());
    }
    if (Active()) {
      Fault("{}second master: somebody else sends frame {:#05x} to the drives", bus.prefix,
            frame.id);
    }
    return;
  }
  bus.off = false;
  bus.unacknowledged = 0;
  if (MayBeDisplaced()) Displaced();
  if (!DispatchToMotors(bus_index, frame, now, utime) &&
      !DispatchToSensors(bus_index, frame, now, utime)) {
    ++bus.rejected;
  }
}

bool Driver::DispatchToMotors(size_t bus, const Frame& frame, int64_t now, int64_t utime) noexcept {
  for (size_t i = 0; i < joints_.size(); ++i) {
    Joint& joint = joints_[i];
    if (joint.bus != bus) continue;
    switch (joint.motor->OnFrame(frame, now)) {
      case FrameUse::kNotMine:
        continue;
      case FrameUse::kRejected:
        return false;
      case FrameUse::kNotFinite:
        joint.not_a_number = true;
        return false;
      case FrameUse::kConsumed:
        return true;
      case FrameUse::kEstimate: {
        const MotorEstimate& estimate = joint.motor->estimate();
        joint.latest = {joint.map.JointPosition(estimate.position),
                        joint.map.JointVelocity(estimate.velocity),
                        joint.map.JointEffort(joint.motor->torque_estimate())};
        joint.measured = true;
        joint.measured_at = now;
        joint.not_a_number = false;
        joint.watch.Add(utime, joint.latest.position, joint.latest.velocity,
                        effort_sent_[joint.index]);
        measurements_.Add(static_cast<int>(i), joint.latest, utime);
        return true;
      }
    }
  }
  return false;
}

bool Driver::DispatchToSensors(size_t bus, const Frame& frame, int64_t now,
                               int64_t utime) noexcept {
  for (JointSensor& sensor : sensors_) {
    if (sensor.bus() != bus) continue;
    if (!Active()) sensor.ForgetTurns();
    const SensorUse use = sensor.OnFrame(frame, now, utime);
    if (use != SensorUse::kNotMine) return use != SensorUse::kRejected;
  }
  return false;
}

void Driver::OnLink(size_t bus, LinkState link) noexcept {
  buses_[bus].link = link;
  if (link != LinkState::kUp && Active()) {
    Fault("{}{}", buses_[bus].prefix,
          link == LinkState::kDown ? "the CAN interface is down" : "the CAN interface is gone");
  }
}

void Driver::Tick(int64_t now, int64_t utime, int64_t lateness) noexcept {
  SetTime(now, utime);
  StampStopTime();
  NoteLateness(lateness);
  for (Bus& bus : buses_) bus.frames.Clear();
  CheckHealth();
  CheckCommand();
  StampStopTime();
  CommandTorques();
  // After the checks, so that a fault is answered in this cycle. The joints take turns to be the
  // first.
  for (Bus& bus : buses_) {
    bus.arming_room =
        std::max(kMaxFrames - std::min(kMaxFrames, bus.torque_frames), kMaxArmingFrames);
  }
  for (size_t i = 0; i < joints_.size(); ++i) {
    Joint& joint = joints_[(turn_ + i) % joints_.size()];
    Bus& bus = buses_[joint.bus];
    const size_t before = bus.frames.size();
    joint.motor->Tick(now, bus.arming_room >= kMaxArmingFrames, bus.frames);
    bus.arming_room -= std::min(bus.arming_room, bus.frames.size() - before);
    joint.frames_end = bus.frames.size();
  }
  turn_ = (turn_ + 1) % joints_.size();
  Poll();
  for (JointSensor& sensor : sensors_) sensor.device().Tick(now, buses_[sensor.bus()].frames);
  LookAtPositions();
  NoteChanges();
}

void Driver::CommandTorques() noexcept {
  const bool commanded = mode_ == Mode::kArmed && !inbox_.empty(),
             fresh = commanded && !inbox_.Expired(now_);
  // A newer command that was never obeyed ends the older one, and does not begin a ramp anew.
  if (commanded) fresh_until_ = fresh ? inbox_.expires() : std::min(fresh_until_, inbox_.expires());
  bool limited = false;
  for (Joint& joint : joints_) {
    joint.effort = 0;
    if (!Active()) continue;
    const double position = joint.latest.position, velocity = joint.latest.velocity;
    double wish = 0;
    if (fresh) {
      wish = inbox_.Effort(static_cast<int>(joint.index), position, velocity);
    } else if (commanded) {
      wish = StoppingEffort(settings_, joint.damping, joint.commanded,
                            InSeconds(now_ - fresh_until_), velocity);
    }
    joint.effort =
        LimitEffort(wish, {position, velocity, effort_sent_[joint.index], InSeconds(cycle_)},
                    joint.limits)
            .value_or(0);
    if (fresh) joint.commanded = joint.effort;
    limited = limited || (fresh && joint.effort != wish);
    FrameBatch& frames = buses_[joint.bus].frames;
    joint.torque_at = frames.size();
    frames.Push(joint.motor->Torque(joint.map.MotorTorque(joint.effort)));
  }
  if (limited) ++status_.commands_limited;
  for (Bus& bus : buses_) bus.torque_frames = bus.frames.size();
}

void Driver::Transmitted(std::span<const int> accepted, int64_t utime) noexcept {
  const auto taken = [&](size_t bus) { return static_cast<size_t>(std::max(accepted[bus], 0)); };
  // A torque that was not accepted leaves the drive with the one before.
  for (const Joint& joint : joints_) {
    const size_t torques = buses_[joint.bus].torque_frames;
    double& sent = effort_sent_[joint.index];
    if (torques == 0) sent = 0;
    if (joint.torque_at < std::min(torques, taken(joint.bus))) sent = joint.effort;
  }
  history_.Record(utime + effort_delay_, effort_sent_);
  for (Joint& joint : joints_) joint.motor->Transmitted(joint.frames_end <= taken(joint.bus), now_);
  for (size_t i = 0; i < buses_.size(); ++i) {
    Bus& bus = buses_[i];
    bus.refused_cycles = taken(i) < bus.frames.size() ? bus.refused_cycles + 1 : 0;
    if (bus.refused_cycles >= kRefusedCycles && Active()) {
      Fault("{}the bus has not accepted frames in {} cycles", bus.prefix, bus.refused_cycles);
    }
  }
}

void Driver::Poll() noexcept {
  if (mode_ == Mode::kArming) return;  // arming has need of all room there is
  for (size_t b = 0; b < buses_.size(); ++b) {
    Bus& bus = buses_[b];
    if (now_ < bus.next_poll) continue;
    bus.next_poll = now_ + bus.poll_period;
    for (size_t i = 0; i < joints_.size(); ++i) {
      const Joint& joint = joints_[(bus.poll_turn + i) % joints_.size()];
      Motor& motor = *joint.motor;
      if (joint.bus != b || motor.num_polled() == 0 || motor.state() == DriveState::kAbsent)
        continue;
      motor.Poll(bus.frames);
      bus.poll_turn = (bus.poll_turn + i + 1) % joints_.size();
      break;
    }
  }
}

bool Driver::MayBeDisplaced() const noexcept {
  // In an episode a policy, or a limit, may want no effort, too: nobody places the robot then.
  const bool in_episode = Active() && inbox_.in_episode();
  return virtual_ && !in_episode &&
         std::ranges::all_of(effort_sent_, [](double effort) { return effort == 0; });
}

void Driver::Displaced() noexcept {
  displaced_at_ = now_;
  for (Joint& joint : joints_) {
    joint.motor->Displaced();
    joint.watch.Displaced();
  }
  for (JointSensor& sensor : sensors_) sensor.Displaced();
}

DriveState Driver::state() const noexcept {
  switch (mode_) {
    case Mode::kArming:
      return DriveState::kArming;
    case Mode::kArmed:
      return DriveState::kArmed;
    case Mode::kFault:
      return DriveState::kFault;
    case Mode::kRest:
      break;
  }
  const bool absent = std::ranges::any_of(
      joints_, [](const Joint& joint) { return joint.motor->state() == DriveState::kAbsent; });
  return absent ? DriveState::kAbsent : DriveState::kIdle;
}

bool Driver::confirmed_idle() const noexcept {
  return std::ranges::all_of(joints_,
                             [](const Joint& joint) { return joint.motor->confirmed_idle(); });
}

}  // namespace plumb
