#include "sim/virtual_robot.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "sim/model.h"

namespace plumb {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;  // [rad]

int64_t Microseconds(double seconds) { return std::llround(seconds * 1e6); }

RobotDescription TrueRobot(const RobotDescription& description, const Eigen::VectorXd& physical) {
  return Model(description).Describe(physical);
}

}  // namespace

VirtualRobot::VirtualRobot(const RobotDescription& description, const Eigen::VectorXd& physical, int64_t now)
    : joints_(description.joints),
      mechanism_(TrueRobot(description, physical)),
      encoders_(joints_.size(), Encoder(description.virtual_robot.encoder_bits)),
      motions_(joints_.size()),
      effort_(Eigen::VectorXd::Zero(description.num_joints())) {
  for (const JointDescription& joint : joints_) {
    if (joint.passive) {
      throw std::invalid_argument("joint '" + joint.name +
                                  "' has no motor, and nothing else on the bus measures it (plumb sim simulates it)");
    }
    if (joint.motor.protocol != "cansimple") {
      throw std::invalid_argument("joint '" + joint.name + "': no virtual drive speaks '" +
                                  joint.motor.protocol + "'; known: cansimple");
    }
    CanSimpleDevice::Settings settings;
    settings.node = joint.motor.node;
    settings.heartbeat_period = Microseconds(description.virtual_robot.heartbeat);
    settings.encoder_period = Microseconds(description.driver.measurement);
    settings.watchdog = Microseconds(description.virtual_robot.watchdog);
    settings.serial_number = static_cast<uint64_t>(joint.motor.node);
    settings_.push_back(settings);
  }
  Boot(now);
}

void VirtualRobot::Boot(int64_t now) {
  time_ = latest_ = now;
  effort_.setZero();
  drives_.clear();
  for (size_t i = 0; i < joints_.size(); ++i) {
    drives_.emplace_back(settings_[i], now);
    encoders_[i].Reset(Turns(i), TurnsPerSecond(i));
  }
}

std::vector<Filter> VirtualRobot::filters() const {
  std::vector<Filter> all;
  for (const CanSimpleDevice& drive : drives_) {
    for (const Filter& filter : drive.filters()) all.push_back(filter);
  }
  return all;
}

void VirtualRobot::Receive(const Frame& frame, int64_t arrival, FrameBatch& out) {
  Advance(arrival, out);
  bool matters =
      frame.remote || frame.length == 0;  // may be a request: its answer is of the shaft as it is now
  for (size_t i = 0; i < drives_.size(); ++i) {
    drives_[i].OnFrame(frame, latest_);
    matters = matters || Effort(i) != effort_[static_cast<Eigen::Index>(i)];
  }
  if (!matters) return;
  MoveTo(latest_);
  Tick(out);
}

int64_t VirtualRobot::NextEvent() const {
  int64_t next = drives_[0].NextDue();
  for (const CanSimpleDevice& drive : drives_) next = std::min(next, drive.NextDue());
  return next;
}

void VirtualRobot::Advance(int64_t now, FrameBatch& out) {
  if (std::abs(now - latest_) > kLongestGap) Boot(now);
  latest_ = std::max(latest_, now);
  for (int64_t next = NextEvent(); next <= latest_; next = NextEvent()) {
    MoveTo(next);
    unsent_.Clear();
    Tick(latest_ - next > kLatest ? unsent_ : out);
  }
}

void VirtualRobot::Tick(FrameBatch& out) {
  for (size_t i = 0; i < drives_.size(); ++i) {
    drives_[i].Tick(time_, Read(i), out);
    effort_[static_cast<Eigen::Index>(i)] = Effort(i);
  }
}

void VirtualRobot::MoveTo(int64_t time) {
  if (time <= time_) return;
  for (size_t i = 0; i < drives_.size(); ++i) motions_[i] = {time_, time, Turns(i), 0, TurnsPerSecond(i), 0};
  // A state that cannot be simulated (nothing sane leads there) ends in standstill, not in a crash.
  if (!mechanism_.Advance(effort_, static_cast<double>(time - time_) * 1e-6)) mechanism_.SetState(0 * q(), 0 * v());
  time_ = time;
  for (size_t i = 0; i < drives_.size(); ++i) {
    motions_[i].end_position = Turns(i);
    motions_[i].end_velocity = TurnsPerSecond(i);
    encoders_[i].Track(motions_[i]);
  }
}

double VirtualRobot::Effort(size_t joint) const {
  const JointDescription& description = joints_[joint];
  const double effort = description.motor.sign * description.motor.gear * drives_[joint].Torque();
  return std::clamp(effort, -description.effort_limit, description.effort_limit);
}

bool VirtualRobot::Place(int64_t utime, const Eigen::Ref<const Eigen::VectorXd>& q,
                         const Eigen::Ref<const Eigen::VectorXd>& v) {
  const auto within_reach = [this](const Eigen::Ref<const Eigen::VectorXd>& x) {
    return x.size() == effort_.size() && (x.array().abs() <= kFarthest).all();  // NaN is not
  };
  if (!within_reach(q) || !within_reach(v)) return false;
  if (utime == placed_) return true;
  placed_ = utime;
  MoveTo(latest_);
  mechanism_.SetState(q, v);
  for (size_t i = 0; i < encoders_.size(); ++i) encoders_[i].Reset(Turns(i), TurnsPerSecond(i));
  return true;
}

double VirtualRobot::Turns(size_t joint) const {
  const MotorDescription& motor = joints_[joint].motor;
  return motor.sign * motor.gear * (q()[static_cast<Eigen::Index>(joint)] - motor.offset) / kTurn;
}

double VirtualRobot::TurnsPerSecond(size_t joint) const {
  const MotorDescription& motor = joints_[joint].motor;
  return motor.sign * motor.gear * v()[static_cast<Eigen::Index>(joint)] / kTurn;
}

CanSimpleDevice::Sample VirtualRobot::Read(size_t joint) const {
  return {encoders_[joint].Quantise(Turns(joint)), encoders_[joint].velocity()};
}

}  // namespace plumb
