#include "drivers/driver.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "drivers/bus_plan.h"

namespace plumb {
namespace {

constexpr int kHistory = 2048;       // cycles of transmitted efforts: ten seconds
constexpr int kRefusedCycles = 10;   // consecutive cycles whose frames were not accepted
constexpr size_t kMostFrames = 8;    // in a cycle while arming: the kernel holds about ten in flight
constexpr int kUnacknowledged = 16;  // consecutive no-acknowledge error frames: nobody is there

int64_t Microseconds(double seconds) { return std::llround(seconds * 1e6); }

MotorTiming TimingOf(const DriverSettings& settings) { return {Microseconds(settings.heartbeat_timeout)}; }

}  // namespace

Driver::Joint::Joint(const JointDescription& joint, const MotorTiming& timing)
    : name(joint.name), motor(MakeMotor(joint.motor, timing)), map(joint.motor), limits(LimitsOf(joint)) {}

Driver::Driver(const RobotDescription& robot, int64_t now, int64_t utime)
    : cycle_(Microseconds(robot.driver.cycle)),
      disarm_after_(Microseconds(robot.driver.disarm_after)),
      stale_after_(Microseconds(robot.driver.stale_after)),
      start_guard_(Microseconds(robot.driver.start_guard)),
      start_now_(now),
      start_utime_(utime),
      measurements_(robot.num_joints(), Microseconds(robot.driver.measurement)),
      inbox_(robot.num_joints(), Microseconds(robot.driver.expiry)),
      history_(robot.num_joints(), kHistory),
      now_(now),
      utime_(utime),
      stopped_utime_(utime - 1),
      armed_by_(utime - 1),
      foreign_at_(now - start_guard_ - 1) {
  joints_.reserve(robot.joints.size());
  for (const JointDescription& joint : robot.joints) {
    if (joint.passive) {
      throw std::invalid_argument(fmt::format("joint '{}' has no motor, and nothing else measures it", joint.name));
    }
    joints_.emplace_back(joint, TimingOf(robot.driver));
    for (const BusMessage& message : MotorBusDevice(joint.motor, robot.driver).messages) {
      if (message.direction != BusMessage::Direction::kToDevice || message.remote || message.extended || message.shared) continue;
      own_.push_back({.id = message.id, .own = true});
    }
  }
  const BusPlan plan = PlanBus(BusDevices(robot), robot.bus_bit_rate);
  if (!plan.errors.empty()) throw std::invalid_argument(fmt::format("the bus cannot work: {}", fmt::join(plan.errors, "; ")));
  effort_sent_.assign(joints_.size(), 0);
  scratch_.resize(joints_.size());
  PrepareMessages();
  reason_.Set("waiting for ARM");
}

std::vector<Filter> Driver::filters() const {
  std::vector<Filter> filters;
  for (const Joint& joint : joints_) filters.push_back(joint.motor->filter());
  filters.insert(filters.end(), own_.begin(), own_.end());
  return filters;
}

void Driver::Disarm() noexcept {
  stopped_utime_ = utime_;
  inbox_.Clear();
  for (Joint& joint : joints_) {
    // One that has failed is being disarmed already, and remembers why.
    if (joint.motor->state() != DriveState::kFault) joint.motor->Disarm(now_);
  }
  mode_ = Mode::kRest;
}

void Driver::OnFrame(const Frame& frame, int64_t now, int64_t utime) noexcept {
  now_ = now;
  ++status_.frames_received;
  switch (DecodeErrorFrame(frame)) {
    case BusEvent::kBusOff:
      bus_off_ = true;
      if (Active()) Fault("the CAN controller went bus-off");
      return;
    case BusEvent::kRestarted:
      bus_off_ = false;
      return;
    case BusEvent::kNoAck:
      if (++unacknowledged_ > kUnacknowledged && Active()) Fault("nobody on the bus acknowledges frames");
      return;
    case BusEvent::kNone:
      break;
  }
  if (frame.error) return;
  if (frame.foreign) {
    foreign_at_ = now;
    if (Active()) Fault("second master: somebody else sends frame {:#05x} to the drives", frame.id);
    return;
  }
  bus_off_ = false;
  unacknowledged_ = 0;
  for (size_t i = 0; i < joints_.size(); ++i) {
    Joint& joint = joints_[i];
    switch (joint.motor->OnFrame(frame, now)) {
      case FrameUse::kNotMine:
        continue;
      case FrameUse::kRejected:
        ++frames_rejected_;
        return;
      case FrameUse::kConsumed:
        return;
      case FrameUse::kEstimate: {
        const MotorEstimate& estimate = joint.motor->estimate();
        joint.latest = {joint.map.JointPosition(estimate.position),
                        joint.map.JointVelocity(estimate.velocity),
                        joint.map.JointEffort(joint.motor->torque_estimate())};
        joint.measured = true;
        joint.measured_at = now;
        measurements_.Add(static_cast<int>(i), joint.latest, utime);
        return;
      }
    }
  }
  ++frames_rejected_;
}

void Driver::OnLink(LinkState link) noexcept {
  link_ = link;
  if (link != LinkState::kUp && Active()) {
    Fault("{}", link == LinkState::kDown ? "the CAN interface is down" : "the CAN interface is gone");
  }
}

std::span<const Frame> Driver::Tick(int64_t now, int64_t utime, int64_t lateness) noexcept {
  now_ = now;
  utime_ = utime;
  NoteLateness(lateness);
  housekeeping_.Clear();
  frames_.Clear();
  CheckHealth();
  CheckCommand();
  CommandTorques();
  // After the checks, so that a fault is answered in this cycle. The joints take turns to be the first.
  size_t arming = torque_frames_ < kMostFrames ? kMostFrames - torque_frames_ : 1;
  for (size_t i = 0; i < joints_.size(); ++i) {
    Joint& joint = joints_[(turn_ + i) % joints_.size()];
    const size_t before = housekeeping_.size();
    joint.motor->Tick(now, arming > 0, housekeeping_);
    arming -= std::min(arming, housekeeping_.size() - before);
    joint.frames_end = torque_frames_ + housekeeping_.size();
  }
  turn_ = (turn_ + 1) % joints_.size();
  for (const Frame& frame : housekeeping_.frames()) frames_.Push(frame);
  NoteChanges();
  return frames_.frames();
}

void Driver::CheckHealth() noexcept {
  if (!Active()) return;
  bool all_armed = true;
  for (const Joint& joint : joints_) {
    const DriveState state = joint.motor->state();
    if (state != DriveState::kArming && state != DriveState::kArmed) {
      return Fault("{}: {}", joint.name, joint.motor->reason());
    }
    if (now_ - joint.measured_at > stale_after_) {
      return Fault("{}: no encoder estimate for {} ms", joint.name, (now_ - joint.measured_at) / 1000);
    }
    all_armed = all_armed && state == DriveState::kArmed;
  }
  if (mode_ == Mode::kArming && all_armed) {
    mode_ = Mode::kArmed;
    armed_at_ = now_;
    reason_.Clear();
  }
}

void Driver::CheckCommand() noexcept {
  if (mode_ != Mode::kArmed) return;
  const int64_t silence = now_ - (inbox_.empty() ? armed_at_ : inbox_.arrival());
  if (silence > disarm_after_) {
    if (inbox_.refusal().empty()) return Fault("no command for {} ms", silence / 1000);
    return Fault("commands refused: {} (none taken for {} ms)", inbox_.refusal(), silence / 1000);
  }
  if (!inbox_.empty() && inbox_.Expired(now_) && !expiry_counted_) {
    ++status_.commands_expired;
    expiry_counted_ = true;
  }
}

void Driver::CommandTorques() noexcept {
  for (size_t i = 0; i < joints_.size(); ++i) {
    Joint& joint = joints_[i];
    joint.wish = 0;
    if (!Active()) continue;
    if (mode_ == Mode::kArmed && !inbox_.Expired(now_)) {
      const double wished = inbox_.Effort(static_cast<int>(i), joint.latest.position, joint.latest.velocity);
      joint.wish =
          LimitEffort(wished, {joint.latest.position, joint.latest.velocity, effort_sent_[i], cycle_ * 1e-6},
                      joint.limits)
              .value_or(0);
    }
    frames_.Push(joint.motor->Torque(joint.map.MotorTorque(joint.wish)));
  }
  torque_frames_ = frames_.size();
}

void Driver::Transmitted(int accepted, int64_t utime) noexcept {
  const auto taken = static_cast<size_t>(std::max(accepted, 0));
  // A torque that was not accepted leaves the drive with the one before.
  for (size_t i = 0; i < joints_.size(); ++i) {
    if (torque_frames_ == 0) effort_sent_[i] = 0;
    if (i < torque_frames_ && i < taken) effort_sent_[i] = joints_[i].wish;
  }
  history_.Record(utime, effort_sent_);
  for (Joint& joint : joints_) joint.motor->Transmitted(joint.frames_end <= taken, now_);
  refused_cycles_ = taken < frames_.size() ? refused_cycles_ + 1 : 0;
  if (refused_cycles_ >= kRefusedCycles && Active()) {
    Fault("the bus has not accepted frames in {} cycles", refused_cycles_);
  }
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
  return std::ranges::all_of(joints_, [](const Joint& joint) { return joint.motor->confirmed_idle(); });
}

}  // namespace plumb
