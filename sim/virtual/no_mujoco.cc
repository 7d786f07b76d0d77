// Of mujoco_backend.h: in place of mujoco_backend.cc where MuJoCo is not installed.
#include <stdexcept>

#include "sim/virtual/mujoco_backend.h"

namespace plumb {

std::unique_ptr<PhysicsBackend> MakeMujocoBackend(const RobotDescription&) {
  throw std::invalid_argument("MuJoCo (libmujoco-dev) was not there when Plumbline was built");
}

bool HasMujoco() { return false; }

}  // namespace plumb
