// In place of mujoco_engine.cc where MuJoCo is not installed.
#include <stdexcept>

#include "sim/mujoco_engine.h"

namespace plumb {

std::unique_ptr<MotionEngine> MakeMujocoEngine(const RobotDescription&) {
  throw std::invalid_argument("MuJoCo (libmujoco-dev) was not there when Plumbline was built");
}

bool HasMujoco() { return false; }

}  // namespace plumb
