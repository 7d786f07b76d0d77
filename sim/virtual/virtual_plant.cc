#include "sim/virtual/virtual_plant.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "sim/virtual/fine_simulator.h"
#include "sim/virtual/mujoco_backend.h"
#include "sim/virtual/ode_backend.h"
#include "sim/virtual/simbody_backend.h"
#include "sim/virtual/simbody_plant.h"
#include "sim/virtual/sprung_masses.h"

namespace plumb {
namespace {

using PlantEngine = VirtualRobotSettings::Engine;

/// Simbody where it can simulate all of the robot, else the simulator.
std::unique_ptr<PhysicsBackend> MakeByNeed(const RobotDescription& robot) {
  if (SimbodyPlant::Lacks(robot).empty()) return std::make_unique<SimbodyPlant>(robot);
  return MakeFineSimulator(robot);
}

/// By `engine` in [virtual_robot]. A new one is its own files and a line here.
struct Backend {
  PlantEngine engine;
  std::string_view name;
  std::unique_ptr<PhysicsBackend> (*make)(const RobotDescription&);
};
constexpr Backend kBackends[] = {
    {PlantEngine::kAuto, "auto", &MakeByNeed},
    {PlantEngine::kMujoco, "mujoco", &MakeMujocoBackend},
    {PlantEngine::kSimbody, "simbody", &MakeSimbodyBackend},
    {PlantEngine::kOde, "ode", &MakeOdeBackend},
};

std::unique_ptr<PhysicsBackend> MakeBackend(const RobotDescription& robot) {
  for (const JointDescription& joint : robot.joints) {
    if (joint.dynamics.sensor_delay != 0 || joint.dynamics.sensor_bias != 0) {
      throw std::invalid_argument(
          "the virtual robot's encoders are right and on time, not like joint '" + joint.name +
          "' of the simulator's");
    }
  }
  const VirtualRobotSettings& wanted = robot.virtual_robot;
  const Backend& backend = *std::ranges::find(kBackends, wanted.engine, &Backend::engine);
  if (backend.engine == PlantEngine::kAuto) return backend.make(robot);
  try {
    return backend.make(robot);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("{}virtual_robot.engine = \"{}\" is not possible: {}",
                                            wanted.engine_source, backend.name, error.what()));
  }
}

/// The robot with all that no model knows of and an engine can be told as if it were known.
RobotDescription AsItIs(RobotDescription robot) {
  for (const UnmodelledJoint& unmodelled : robot.virtual_robot.joints) {
    JointDynamics& dynamics = robot.joints[static_cast<size_t>(unmodelled.joint)].dynamics;
    dynamics.friction += unmodelled.friction;
    dynamics.armature = std::max(0.0, dynamics.armature - unmodelled.rotor);  // before the play
  }
  if (robot.virtual_robot.ground.friction)
    robot.simulation.contact->friction = *robot.virtual_robot.ground.friction;
  return WithSprungMasses(std::move(robot));
}

}  // namespace

VirtualPlant::VirtualPlant(const RobotDescription& robot) : VirtualPlant(robot, AsItIs(robot)) {}

VirtualPlant::VirtualPlant(const RobotDescription& robot, const RobotDescription& real)
    : backend_(MakeBackend(real)),
      play_(real),
      q_(robot.num_positions()),
      v_(robot.num_velocities()),
      motor_q_(q_.size()),
      motor_v_(v_.size()),
      all_q_(Eigen::VectorXd::Zero(real.num_positions())),
      all_v_(Eigen::VectorXd::Zero(real.num_velocities())),
      all_effort_(all_v_) {
  Show();
}

void VirtualPlant::SetState(const Vector& q, const Vector& v) {
  if (q.size() != q_.size() || v.size() != v_.size()) {
    throw std::invalid_argument(
        fmt::format("a state has {} positions and {} velocities", q_.size(), v_.size()));
  }
  all_q_.head(q.size()) = q;
  all_v_.head(v.size()) = v;
  backend_->SetState(all_q_, all_v_);
  if (play_.any()) play_.Place(backend_->q(), backend_->v());
  Show();
}

bool VirtualPlant::Advance(const Vector& effort, double duration) {
  all_effort_.head(effort.size()) = effort;
  const bool done = play_.any() ? play_.Advance(all_effort_, duration, *backend_)
                                : backend_->Advance(all_effort_, duration);
  Show();
  return done;
}

void VirtualPlant::Show() {
  q_ = backend_->q().head(q_.size());
  v_ = backend_->v().head(v_.size());
  motor_q_ = play_.any() ? play_.q().head(q_.size()) : q_;
  motor_v_ = play_.any() ? play_.v().head(v_.size()) : v_;
}

}  // namespace plumb
