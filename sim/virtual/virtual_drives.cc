// Of virtual_devices.h: drives, each a protocol's device and an encoder on the motor's shaft.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "drivers/driver/joint_map.h"
#include "drivers/protocols/cansimple_device.h"
#include "drivers/protocols/mit_device.h"
#include "sim/virtual/encoder.h"
#include "sim/virtual/virtual_devices.h"

namespace plumb {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;  // [rad]

int64_t Microseconds(double seconds) { return std::llround(seconds * 1e6); }

/// What all drives have: a joint, a shaft, an encoder.
class VirtualDrive : public VirtualDevice {
 public:
  VirtualDrive(const RobotDescription& robot, int joint)
      : joint_(joint),
        limit_(robot.joints[static_cast<size_t>(joint)].effort_limit),
        map_(robot.joints[static_cast<size_t>(joint)].motor),
        encoder_(robot.virtual_robot.encoder_bits) {
    for (int i = 0; i < joint; ++i) {
      q_index_ += robot.joints[static_cast<size_t>(i)].num_positions();
      v_index_ += robot.joints[static_cast<size_t>(i)].num_velocities();
    }
  }

  int joint() const override { return joint_; }
  double Effort() const override { return std::clamp(map_.JointEffort(Torque()), -limit_, limit_); }

  void Boot(const RobotMotion& motion) override {
    Restart(motion.time);
    Place(motion);
  }
  void Track(const RobotMotion& from, const RobotMotion& to) override {
    encoder_.Track(
        {from.time, to.time, Turns(from), Turns(to), TurnsPerSecond(from), TurnsPerSecond(to)});
  }
  void Place(const RobotMotion& motion) override {
    encoder_.Reset(Turns(motion), TurnsPerSecond(motion));
  }

 protected:
  virtual double Torque() const = 0;  ///< [Nm] of the motor
  virtual void Restart(int64_t now) = 0;

  double Turns(const RobotMotion& motion) const {
    return map_.MotorPosition(motion.motor_q[q_index_]) / kTurn;
  }
  double TurnsPerSecond(const RobotMotion& motion) const {
    return map_.MotorVelocity(motion.motor_v[v_index_]) / kTurn;
  }
  double ReadTurns(const RobotMotion& motion) const { return encoder_.Quantise(Turns(motion)); }
  double ReadTurnsPerSecond() const { return encoder_.velocity(); }

 private:
  int joint_;
  double limit_;
  JointMap map_;
  Encoder encoder_;
  Eigen::Index q_index_ = 0, v_index_ = 0;
};

class VirtualOdrive : public VirtualDrive {
 public:
  VirtualOdrive(const RobotDescription& robot, int joint) : VirtualDrive(robot, joint) {
    const int node = robot.joints[static_cast<size_t>(joint)].motor.node;
    settings_.node = node;
    settings_.heartbeat_period = Microseconds(robot.virtual_robot.heartbeat);
    settings_.encoder_period = Microseconds(robot.driver.measurement);
    settings_.watchdog = Microseconds(robot.virtual_robot.watchdog);
    settings_.serial_number = static_cast<uint64_t>(node);
    device_.emplace(settings_, 0);
  }

  std::vector<Filter> filters() const override {
    const auto filters = device_->filters();
    return {filters.begin(), filters.end()};
  }
  bool OnFrame(const Frame& frame, int64_t now) override {
    const double before = Torque();
    device_->OnFrame(frame, now);
    // May be a request: its answer is of the shaft as it is now.
    return frame.remote || frame.length == 0 || Torque() != before;
  }
  void Tick(const RobotMotion& motion, FrameBatch& out) override {
    device_->Tick(motion.time, {ReadTurns(motion), ReadTurnsPerSecond()}, out);
  }
  int64_t NextDue() const override { return device_->NextDue(); }
  bool armed() const override { return device_->armed(); }
  uint32_t disarm_reason() const override { return device_->disarm_reason(); }
  int64_t rejected() const override { return device_->rejected(); }

 protected:
  double Torque() const override { return device_->Torque(); }
  void Restart(int64_t now) override { device_.emplace(settings_, now); }

 private:
  CanSimpleDevice::Settings settings_;
  std::optional<CanSimpleDevice> device_;
};

/// Its gains, if somebody gives it any, act on the motion at its last event.
class VirtualMitMotor : public VirtualDrive {
 public:
  VirtualMitMotor(const RobotDescription& robot, int joint) : VirtualDrive(robot, joint) {
    const MotorDescription& motor = robot.joints[static_cast<size_t>(joint)].motor;
    if (!motor.mit) throw std::invalid_argument("a motor of protocol 'mit' needs its ranges");
    settings_.node = motor.node;
    settings_.master = motor.mit->master;
    settings_.ranges = motor.mit->ranges;
    settings_.watchdog = Microseconds(robot.virtual_robot.watchdog);
    device_.emplace(settings_);
  }

  std::vector<Filter> filters() const override { return {device_->filter()}; }
  bool OnFrame(const Frame& frame, int64_t now) override {
    device_->OnFrame(frame, now);
    torque_ = device_->Torque(sample_);
    // it answers everything
    return !frame.remote && frame.id == static_cast<uint32_t>(settings_.node);
  }
  void Tick(const RobotMotion& motion, FrameBatch& out) override {
    sample_ = {ReadTurns(motion) * kTurn, ReadTurnsPerSecond() * kTurn};
    device_->Tick(motion.time, sample_, out);
    torque_ = device_->Torque(sample_);
  }
  int64_t NextDue() const override { return device_->NextDue(); }
  bool armed() const override { return device_->armed(); }
  int64_t rejected() const override { return device_->rejected(); }

 protected:
  double Torque() const override { return torque_; }
  void Restart(int64_t) override {
    device_.emplace(settings_);
    torque_ = 0;
  }

 private:
  MitDevice::Settings settings_;
  std::optional<MitDevice> device_;
  MitDevice::Sample sample_;
  double torque_ = 0;
};

}  // namespace

std::unique_ptr<VirtualDevice> MakeVirtualDrive(const RobotDescription& robot, int joint) {
  const JointDescription& description = robot.joints[static_cast<size_t>(joint)];
  const std::string& protocol = description.motor.protocol;
  if (protocol == "cansimple") return std::make_unique<VirtualOdrive>(robot, joint);
  if (protocol == "mit") return std::make_unique<VirtualMitMotor>(robot, joint);
  throw std::invalid_argument("joint '" + description.name + "': no virtual drive speaks '" +
                              protocol + "'; known: cansimple, mit");
}

}  // namespace plumb
