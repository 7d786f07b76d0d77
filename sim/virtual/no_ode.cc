// Of ode_backend.h: in place of ode_backend.cc where ODE is not installed.
#include <stdexcept>

#include "sim/virtual/ode_backend.h"

namespace plumb {

std::unique_ptr<PhysicsBackend> MakeOdeBackend(const RobotDescription&) {
  throw std::invalid_argument("ODE (libode-dev) was not there when Plumbline was built");
}

bool HasOde() { return false; }

}  // namespace plumb
