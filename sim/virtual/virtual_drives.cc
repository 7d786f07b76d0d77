// Of virtual_devices.h: drives, each a protocol's device and an encoder on the motor's shaft.

#include <algorithm>
#include <numbers>

#include "common/time_units.h"
#include "drivers/driver/joint_map.h"
#include "drivers/protocols/registry.h"
#include "sim/virtual/encoder.h"
#include "sim/virtual/virtual_devices.h"

namespace plumb {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;  // [rad]

class VirtualDrive : public VirtualDevice {
 public:
  VirtualDrive(const RobotDescription& robot, int joint)
      : joint_(joint),
        limit_(robot.joints[static_cast<size_t>(joint)].effort_limit),
        map_(robot.joints[static_cast<size_t>(joint)].motor),
        encoder_(robot.virtual_robot.encoder_bits),
        device_(MakeMotorDevice(robot, joint)),
        q_index_(robot.position_of(joint)),
        v_index_(robot.velocity_of(joint)) {}

  std::vector<Filter> filters() const override { return device_->filters(); }
  bool OnFrame(const Frame& frame, int64_t now) override { return device_->OnFrame(frame, now); }
  void Tick(const RobotMotion& motion, FrameBatch& out) override {
    device_->Tick(motion.time, {encoder_.Quantise(Turns(motion)), encoder_.velocity()}, out);
  }
  int64_t NextDue() const override { return device_->NextDue(); }

  void Boot(const RobotMotion& motion) override {
    device_->Boot(motion.time);
    Place(motion);
  }
  void Track(const RobotMotion& from, const RobotMotion& to) override {
    encoder_.Track(
        {from.time, to.time, Turns(from), Turns(to), TurnsPerSecond(from), TurnsPerSecond(to)});
  }
  void Place(const RobotMotion& motion) override {
    encoder_.Reset(Turns(motion), TurnsPerSecond(motion));
  }

  int joint() const override { return joint_; }
  double Effort() const override {
    return std::clamp(map_.JointEffort(device_->Torque()), -limit_, limit_);
  }
  bool armed() const override { return device_->armed(); }
  uint32_t disarm_reason() const override { return device_->disarm_reason(); }
  int64_t rejected() const override { return device_->rejected(); }

 private:
  double Turns(const RobotMotion& motion) const {
    return map_.MotorPosition(motion.motor_q[q_index_]) / kTurn;
  }
  double TurnsPerSecond(const RobotMotion& motion) const {
    return map_.MotorVelocity(motion.motor_v[v_index_]) / kTurn;
  }

  int joint_;
  double limit_;
  JointMap map_;
  Encoder encoder_;
  std::unique_ptr<MotorDevice> device_;
  Eigen::Index q_index_, v_index_;
};

}  // namespace

std::unique_ptr<VirtualDevice> MakeVirtualDrive(const RobotDescription& robot, int joint) {
  return std::make_unique<VirtualDrive>(robot, joint);
}

}  // namespace plumb
