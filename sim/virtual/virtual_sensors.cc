// Of virtual_devices.h: sensors: encoders on joints, IMUs on links.

#include <Eigen/Geometry>
#include <optional>
#include <stdexcept>

#include "common/time_units.h"
#include "drivers/protocols/registry.h"
#include "robot/kinematics.h"
#include "sim/virtual/virtual_devices.h"

namespace plumb {
namespace {

class VirtualEncoder : public VirtualDevice {
 public:
  VirtualEncoder(const RobotDescription& robot, const SensorDescription& sensor)
      : scale_(sensor.sign * sensor.radius),
        offset_(sensor.offset),
        device_(MakeSensorDevice(sensor)),
        index_(robot.position_of(sensor.joint)) {}

  std::vector<Filter> filters() const override { return device_->filters(); }
  bool OnFrame(const Frame& frame, int64_t now) override {
    device_->OnFrame(frame, now);
    return false;  // what it answers says nothing of the motion
  }
  void Tick(const RobotMotion& motion, FrameBatch& out) override {
    device_->Tick(motion.time, {.position = (motion.q[index_] - offset_) / scale_}, out);
  }
  int64_t NextDue() const override { return device_->NextDue(); }
  void Boot(const RobotMotion& motion) override { device_->Boot(motion.time); }
  void Track(const RobotMotion&, const RobotMotion&) override {}
  void Place(const RobotMotion&) override {}
  int64_t rejected() const override { return device_->rejected(); }

 private:
  double scale_, offset_;
  std::unique_ptr<SensorDevice> device_;
  Eigen::Index index_;
};

/// At its link's origin. Its orientation counts from the ground, which it has been levelled on; its
/// force has gravity as that is there. It measures as such sensors do, by the change of its
/// velocity in a period: the force of an impact is spread over one.
class VirtualImu : public VirtualDevice {
 public:
  VirtualImu(const RobotDescription& robot, const SensorDescription& sensor)
      : kinematics_(robot),
        gravity_(robot.simulation.gravity * robot.virtual_robot.ground.Down()),
        link_(sensor.link),
        to_link_(sensor.rotation),
        device_(MakeSensorDevice(sensor)) {}

  std::vector<Filter> filters() const override { return device_->filters(); }
  bool OnFrame(const Frame& frame, int64_t now) override {
    device_->OnFrame(frame, now);
    return false;  // what it answers says nothing of the motion
  }
  void Tick(const RobotMotion& motion, FrameBatch& out) override {
    if (motion.time < device_->NextDue()) return;
    kinematics_.Update(motion.q, motion.v);
    const LinkMotion& link = kinematics_.link(link_);
    const double elapsed = Seconds(motion.time - last_time_);
    const Eigen::Vector3d acceleration =
        elapsed > 0 ? Eigen::Vector3d((link.velocity - last_velocity_) / elapsed)
                    : Eigen::Vector3d::Zero();
    last_time_ = motion.time;
    last_velocity_ = link.velocity;
    const Eigen::Matrix3d axes = link.rotation * to_link_;  // the sensor's -> the base's
    SensedMotion sample;
    Eigen::Map<Eigen::Vector3d>(sample.rate.data()) = axes.transpose() * link.rate;
    Eigen::Map<Eigen::Vector3d>(sample.force.data()) = axes.transpose() * (acceleration - gravity_);
    const Eigen::Quaterniond orientation(axes);
    sample.orientation = {orientation.w(), orientation.x(), orientation.y(), orientation.z()};
    device_->Tick(motion.time, sample, out);
  }
  int64_t NextDue() const override { return device_->NextDue(); }
  void Boot(const RobotMotion& motion) override {
    device_->Boot(motion.time);
    Place(motion);
  }
  void Track(const RobotMotion&, const RobotMotion&) override {}
  void Place(const RobotMotion& motion) override {
    last_time_ = motion.time;
    kinematics_.Update(motion.q, motion.v);
    last_velocity_ = kinematics_.link(link_).velocity;
  }
  int64_t rejected() const override { return device_->rejected(); }

 private:
  Kinematics kinematics_;
  Eigen::Vector3d gravity_;  // [m/s^2]
  int link_;
  Eigen::Matrix3d to_link_;
  std::unique_ptr<SensorDevice> device_;
  int64_t last_time_ = 0;
  Eigen::Vector3d last_velocity_ = Eigen::Vector3d::Zero();
};

}  // namespace

std::unique_ptr<VirtualDevice> MakeVirtualSensor(const RobotDescription& robot,
                                                 const SensorDescription& sensor) {
  if (sensor.link >= 0) return std::make_unique<VirtualImu>(robot, sensor);
  return std::make_unique<VirtualEncoder>(robot, sensor);
}

std::vector<std::unique_ptr<VirtualDevice>> VirtualDevices(const RobotDescription& robot) {
  std::vector<std::unique_ptr<VirtualDevice>> devices;
  for (int i = 0; i < robot.num_joints(); ++i) {
    if (!robot.joints[static_cast<size_t>(i)].passive)
      devices.push_back(MakeVirtualDrive(robot, i));
  }
  for (const SensorDescription& sensor : robot.sensors)
    devices.push_back(MakeVirtualSensor(robot, sensor));
  return devices;
}

}  // namespace plumb
