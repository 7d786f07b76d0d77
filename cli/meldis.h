#pragma once

#include <string>

#include "common/process.h"

namespace plumb {

/// `plumb meldis`: says what Drake's meldis draws (DRAKE_VIEWER_LOAD_ROBOT, DRAKE_VIEWER_DRAW) of
/// the robot's state that is heard, live or replayed, at 40 Hz, until it is asked to stop. It only
/// looks on: it believes everybody. Not thread-safe.
/// @param robot folder or TOML file. @return exit status.
/// @throws ConfigError of the robot; std::invalid_argument in a run in virtual time, which it looks
/// at from outside.
int ShowInMeldis(Process& process, const std::string& robot);

}  // namespace plumb
