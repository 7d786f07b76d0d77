#include "robot/settings/controller.h"

#include "robot/settings/ranges.h"

namespace plumb {

ControllerSettings ReadController(Config config) {
  ControllerSettings s;
  s.state_timeout = config.Number("state_timeout", {1e-3, 10});
  s.place_tolerance = config.Number("place_tolerance", kSanePositive);
  config.Finish();
  return s;
}

}  // namespace plumb
