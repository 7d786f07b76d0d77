#include "sim/virtual/gear_play.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <stdexcept>

#include "common/decompositions.h"
#include "sim/simulator.h"

namespace plumb {
namespace {

constexpr double kPhase =
    0.3;  // [rad] of the teeth's own swing in a step; the midpoint rule is stable up to 2

}  // namespace

GearPlay::GearPlay(const RobotDescription& robot) {
  for (const UnmodelledJoint& unmodelled : robot.virtual_robot.joints) {
    if (unmodelled.backlash == 0) continue;
    const auto index = static_cast<size_t>(unmodelled.joint);
    for (const JointParameterKind& kind : kJointParameterKinds) {
      if (kind.joints != JointGroup::kDriven) continue;
      if (robot.joints[index].dynamics.*kind.member == JointDynamics{}.*kind.member) continue;
      throw std::invalid_argument("joint '" + robot.joints[index].name + "' has backlash: its " +
                                  kind.key + " has no place");
    }
    gears_.push_back({.position = robot.position_of(unmodelled.joint),
                      .velocity = robot.velocity_of(unmodelled.joint),
                      .half = unmodelled.backlash / 2,
                      .rotor = unmodelled.rotor,
                      .stiffness = robot.joints[index].effort_limit / (kBend * unmodelled.backlash),
                      .damping = 0});
  }
  if (gears_.empty()) return;
  // In the zero pose; elsewhere the teeth are as stiff.
  RobotDescription known = robot;
  known.parameters.clear();
  Simulator simulator(known);
  const Eigen::MatrixXd mobility = Inverse(simulator.MassMatrix());
  for (Gear& gear : gears_) {
    const double reduced = 1 / (1 / gear.rotor + mobility(gear.velocity, gear.velocity));
    const double rate =
        std::max(2 * std::numbers::pi * kToothFrequency, std::sqrt(gear.stiffness / reduced));
    gear.stiffness = reduced * rate * rate;
    gear.damping = 2 * kToothDamping * reduced * rate;
    longest_step_ = std::min(longest_step_, kPhase / rate);
  }
  if (longest_step_ < kShortestStep) {
    throw std::invalid_argument(
        "a gear's backlash is too narrow, or its rotor too light, to be simulated");
  }
  Place(simulator.q(), simulator.v());
}

void GearPlay::Place(const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
  q_ = q;
  v_ = v;
  for (Gear& gear : gears_) {
    gear.angle = q[gear.position];
    gear.speed = v[gear.velocity];
  }
}

bool GearPlay::Advance(const PhysicsBackend::Vector& effort, double duration,
                       PhysicsBackend& engine) {
  const double count = std::ceil(duration / longest_step_ - 1e-6);
  const double h = count > 0 ? duration / count : 0;
  const Eigen::VectorXd q = engine.q(), v = engine.v();
  const std::vector<Gear> gears = gears_;
  for (int64_t step = 0; static_cast<double>(step) < count; ++step) {
    effort_ = effort;
    for (Gear& gear : gears_) {
      const double rate = gear.speed - engine.v()[gear.velocity];
      const double offset = gear.angle - engine.q()[gear.position] + h / 2 * rate;
      const double side = offset > 0 ? 1 : -1;
      const double depth = side * offset - gear.half;
      const double push =
          depth > 0 ? std::max(0.0, gear.stiffness * depth + gear.damping * side * rate) : 0;
      effort_[gear.velocity] = side * push;
    }
    if (!effort_.allFinite() || !engine.Advance(effort_, h)) {
      engine.SetState(q, v);
      gears_ = gears;
      return false;
    }
    for (Gear& gear : gears_) {
      const double acceleration = (effort[gear.velocity] - effort_[gear.velocity]) / gear.rotor;
      gear.angle += h * gear.speed + h * h / 2 * acceleration;
      gear.speed += h * acceleration;
    }
  }
  Show(engine);
  return true;
}

void GearPlay::Show(const PhysicsBackend& engine) {
  q_ = engine.q();
  v_ = engine.v();
  for (const Gear& gear : gears_) {
    q_[gear.position] = gear.angle;
    v_[gear.velocity] = gear.speed;
  }
}

}  // namespace plumb
