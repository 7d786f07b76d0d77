#pragma once

#include "common/config.h"

namespace plumb {

/// [controller].
struct ControllerSettings {
  double state_timeout;    ///< [s]
  double place_tolerance;  ///< [rad]; times ten [rad/s]
};

/// Thread-safe. @throws ConfigError
ControllerSettings ReadController(Config config);

}  // namespace plumb
