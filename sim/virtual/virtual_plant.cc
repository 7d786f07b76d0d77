#include "sim/virtual/virtual_plant.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "sim/virtual/fine_simulator.h"
#include "sim/virtual/mujoco_backend.h"
#include "sim/virtual/simbody_plant.h"

namespace plumb {
namespace {

using Engine = VirtualRobotSettings::Engine;

/// Simbody where it can simulate all of the robot, else the simulator.
std::unique_ptr<PhysicsBackend> MakeByNeed(const RobotDescription& robot) {
  if (SimbodyPlant::Lacks(robot).empty()) return std::make_unique<SimbodyPlant>(robot);
  return MakeFineSimulator(robot);
}

/// By `engine` in [virtual_robot]. A new one is its own files and a line here.
struct Backend {
  Engine engine;
  std::string_view name;
  std::unique_ptr<PhysicsBackend> (*make)(const RobotDescription&);
};
constexpr Backend kBackends[] = {
    {Engine::kAuto, "auto", &MakeByNeed},
    {Engine::kMujoco, "mujoco", &MakeMujocoBackend},
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
  if (backend.engine == Engine::kAuto) return backend.make(robot);
  try {
    return backend.make(robot);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("{}virtual_robot.engine = \"{}\" is not possible: {}",
                                            wanted.engine_source, backend.name, error.what()));
  }
}

RobotDescription WithFriction(RobotDescription robot) {
  for (const UnmodelledJoint& unmodelled : robot.virtual_robot.joints) {
    robot.joints[static_cast<size_t>(unmodelled.joint)].dynamics.friction += unmodelled.friction;
  }
  return robot;
}

}  // namespace

VirtualPlant::VirtualPlant(RobotDescription robot)
    : backend_(MakeBackend(robot = WithFriction(std::move(robot)))), play_(robot) {}

void VirtualPlant::SetState(const Vector& q, const Vector& v) {
  backend_->SetState(q, v);
  if (play_.any()) play_.Place(backend_->q(), backend_->v());
}

bool VirtualPlant::Advance(const Vector& effort, double duration) {
  return play_.any() ? play_.Advance(effort, duration, *backend_)
                     : backend_->Advance(effort, duration);
}

}  // namespace plumb
