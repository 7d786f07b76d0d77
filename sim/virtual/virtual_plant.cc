#include "sim/virtual/virtual_plant.h"

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <utility>

#include "sim/simulator.h"
#include "sim/virtual/mujoco_backend.h"
#include "sim/virtual/simbody_plant.h"

namespace plumb {
namespace {

/// A Simulator in finer steps than any that calibrates.
class FineSimulator : public PhysicsBackend {
 public:
  explicit FineSimulator(const RobotDescription& robot) : simulator_(Finer(robot)) {}

  void SetState(const Vector& q, const Vector& v) override { simulator_.SetState(q, v); }
  bool Advance(const Vector& effort, double duration) override {
    if (!effort.allFinite()) return false;
    q_ = simulator_.q();
    v_ = simulator_.v();
    simulator_.Step(effort, duration);
    if (simulator_.finite()) return true;
    simulator_.SetState(q_, v_);
    return false;
  }
  const Eigen::VectorXd& q() const override { return simulator_.q(); }
  const Eigen::VectorXd& v() const override { return simulator_.v(); }

 private:
  static RobotDescription Finer(RobotDescription robot) {
    robot.parameters.clear();
    robot.simulation.integrator = SimulationSettings::Integrator::kLeapfrog;
    robot.simulation.speed_clip = std::numeric_limits<double>::infinity();
    robot.simulation.substep =
        std::min(robot.simulation.substep / 10, VirtualPlant::kLongestSubstep);
    return robot;
  }

  Simulator simulator_;
  Eigen::VectorXd q_, v_;  // where it was
};

std::unique_ptr<PhysicsBackend> MakeEngine(const RobotDescription& robot) {
  for (const JointDescription& joint : robot.joints) {
    if (joint.dynamics.sensor_delay != 0 || joint.dynamics.sensor_bias != 0) {
      throw std::invalid_argument(
          "the virtual robot's encoders are right and on time, not like joint '" + joint.name +
          "' of the simulator's");
    }
  }
  if (robot.virtual_robot.engine == VirtualRobotSettings::Engine::kMujoco) {
    try {
      return MakeMujocoBackend(robot);
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(
          robot.virtual_robot.engine_source +
          "virtual_robot.engine = \"mujoco\" is not possible: " + error.what());
    }
  }
  if (SimbodyPlant::Lacks(robot).empty()) return std::make_unique<SimbodyPlant>(robot);
  return std::make_unique<FineSimulator>(robot);
}

RobotDescription WithFriction(RobotDescription robot) {
  for (const UnmodelledJoint& unmodelled : robot.virtual_robot.joints) {
    robot.joints[static_cast<size_t>(unmodelled.joint)].dynamics.friction += unmodelled.friction;
  }
  return robot;
}

}  // namespace

VirtualPlant::VirtualPlant(RobotDescription robot)
    : engine_(MakeEngine(robot = WithFriction(std::move(robot)))), play_(robot) {}

void VirtualPlant::SetState(const Vector& q, const Vector& v) {
  engine_->SetState(q, v);
  if (play_.any()) play_.Place(engine_->q(), engine_->v());
}

bool VirtualPlant::Advance(const Vector& effort, double duration) {
  return play_.any() ? play_.Advance(effort, duration, *engine_)
                     : engine_->Advance(effort, duration);
}

}  // namespace plumb
