// Of driver.h: its construction: joints with motors, sensors, the buses that they share.

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <stdexcept>

#include "common/time_units.h"
#include "drivers/bus/bus_plan.h"
#include "drivers/driver/driver.h"
#include "drivers/protocols/registry.h"
#include "robot/floating_base.h"

namespace plumb {
namespace {

constexpr int kHistory = 2048;  // cycles of transmitted efforts: 4 s of 2 ms

// What nobody but us may send to that motor.
std::vector<Filter> OwnFilters(const MotorDescription& motor, const DriverSettings& settings) {
  const BusDevice device = MotorBusDevice(motor, settings);
  std::vector<Filter> own;
  for (const BusMessage& message : device.messages) {
    if (message.direction != BusMessage::Direction::kToDevice || message.remote) continue;
    own.push_back({.id = message.id,
                   .mask = (message.extended ? Filter::kAllExtended : 0x7FF) & ~message.sender_bits,
                   .own = true,
                   .extended = message.extended});
  }
  for (const uint32_t id : device.obeys) own.push_back({.id = id, .mask = 0x7FF, .own = true});
  return own;
}

MotorTiming TimingOf(const DriverSettings& settings) {
  return {Microseconds(settings.heartbeat_timeout)};
}

}  // namespace

Driver::Joint::Joint(size_t number, const JointDescription& joint, const DriverSettings& settings)
    : index(number),
      name(joint.name),
      motor(MakeMotor(joint.motor, TimingOf(settings))),
      map(joint.motor),
      limits(LimitsOf(joint)),
      damping(joint.limits.damping),
      turns(joint.type != JointDescription::Type::kPrismatic),
      watch(PlausibilityOf(joint, settings)),
      position_watch(joint),
      bus(joint.motor.bus) {}

Driver::Driver(const RobotDescription& robot, int64_t now, int64_t utime)
    : settings_(robot.driver),
      cycle_(Microseconds(robot.driver.cycle)),
      measurement_(Microseconds(robot.driver.measurement)),
      disarm_after_(Microseconds(robot.driver.disarm_after)),
      stale_after_(Microseconds(robot.driver.stale_after)),
      start_guard_(Microseconds(robot.driver.start_guard)),
      effort_delay_(Microseconds(robot.driver.effort_delay)),
      start_now_(now),
      num_joints_(robot.joints.size()),
      joints_(DrivenJoints(robot)),
      measurements_(static_cast<int>(joints_.size()), measurement_),
      inbox_(robot.num_joints(), Microseconds(robot.driver.expiry)),
      history_(robot.num_joints(), kHistory),
      now_(now),
      utime_(utime),
      clock_offset_(utime - now),
      start_utime_(utime),
      stopped_utime_(utime - 1),
      armed_by_(utime - 1) {
  for (const JointDescription& joint : robot.joints) names_.push_back(joint.name);
  for (const SensorDescription& sensor : robot.sensors)
    sensors_.emplace_back(robot, sensor, stale_after_);
  buses_ = Buses(robot);
  FindPassiveSensors(robot);
  FindSecondEncoders(robot);
  effort_sent_.assign(num_joints_, 0);
  scratch_.resize(joints_.size());
  PrepareMessages();
  status_.robot = robot.name;
  status_.bus = InOneLine(robot.buses);
  status_.num_buses = static_cast<int32_t>(buses_.size());
  status_.buses.resize(buses_.size());
  for (size_t i = 0; i < buses_.size(); ++i) {
    status_.buses[i].name = robot.buses[i].name;
    status_.buses[i].url = robot.buses[i].url;
  }
  reason_.Set("waiting for ARM");
}

std::vector<Driver::Joint> Driver::DrivenJoints(const RobotDescription& robot) {
  if (robot.task.period >= robot.driver.expiry)
    throw std::invalid_argument(
        fmt::format("[driver] expiry = {} s is not longer than [task] period = {} s: each command "
                    "would be void before the next one comes",
                    robot.driver.expiry, robot.task.period));
  std::vector<Joint> joints;
  for (size_t i = 0; i < robot.joints.size(); ++i) {
    if (!robot.joints[i].passive) joints.emplace_back(i, robot.joints[i], robot.driver);
  }
  if (joints.empty()) throw std::invalid_argument("no joint has a motor");
  return joints;
}

std::vector<Driver::Bus> Driver::Buses(const RobotDescription& robot) const {
  std::vector<Bus> buses;
  for (size_t i = 0; i < robot.buses.size(); ++i) {
    const BusDescription& description = robot.buses[i];
    const BusPlan plan = PlanBus(robot, i);
    if (!plan.errors.empty()) {
      throw std::invalid_argument(
          fmt::format("{} cannot work: {}", description.Label(), fmt::join(plan.errors, "; ")));
    }
    int polled = 0;
    for (const Joint& joint : joints_) polled += joint.bus == i ? joint.motor->num_polled() : 0;
    Bus bus;
    if (!description.name.empty()) bus.prefix = description.Label() + ": ";
    for (const JointDescription& joint : robot.joints) {
      if (joint.passive || joint.motor.bus != i) continue;
      const std::vector<Filter> own = OwnFilters(joint.motor, robot.driver);
      bus.own.insert(bus.own.end(), own.begin(), own.end());
    }
    bus.foreign_at = start_now_ - start_guard_ - 1;
    bus.poll_period = std::max(cycle_, Microseconds(settings_.telemetry) / std::max(1, polled));
    bus.next_poll = start_now_;
    buses.push_back(bus);
  }
  return buses;
}

void Driver::FindPassiveSensors(const RobotDescription& robot) {
  std::optional<FloatingBase> base;
  if (robot.estimator.base == EstimatorSettings::Base::kLegs) base = FloatingBaseOf(robot);
  for (size_t i = 0; i < num_joints_; ++i) {
    const JointDescription& joint = robot.joints[i];
    if (!joint.passive) continue;
    const auto sensor = std::ranges::find(sensors_, static_cast<int>(i), &JointSensor::joint);
    // the estimator finds out
    if (sensor == sensors_.end() && base && base->Has(static_cast<int>(i))) continue;
    if (sensor == sensors_.end()) {
      throw std::invalid_argument(fmt::format(
          "joint '{}' has no motor, and no sensor measures it: give it one with [[sensor]]",
          joint.name));
    }
    passive_.push_back({i, static_cast<size_t>(sensor - sensors_.begin()), PositionWatch(joint)});
  }
}

void Driver::FindSecondEncoders(const RobotDescription& robot) {
  for (size_t i = 0; i < sensors_.size(); ++i) {
    const auto joint = std::ranges::find(joints_, sensors_[i].joint(),
                                         [](const Joint& j) { return static_cast<int>(j.index); });
    const double tolerance = robot.sensors[i].tolerance;
    if (joint == joints_.end() || std::isinf(tolerance)) continue;
    second_encoders_.push_back({static_cast<size_t>(joint - joints_.begin()), i, tolerance});
  }
}

std::vector<Filter> Driver::filters(size_t bus) const {
  std::vector<Filter> filters;
  for (const Joint& joint : joints_) {
    if (joint.bus == bus) filters.push_back(joint.motor->filter());
  }
  for (const JointSensor& sensor : sensors_) {
    if (sensor.bus() == bus)
      std::ranges::copy(sensor.device().filters(), std::back_inserter(filters));
  }
  std::ranges::copy(buses_[bus].own, std::back_inserter(filters));
  return filters;
}

}  // namespace plumb
