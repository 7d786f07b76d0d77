#pragma once

#include <memory>
#include <string>
#include <vector>

#include "drivers/can/transport.h"

namespace plumb {

/// A log instead of a bus: what candump -l or python-can wrote (see candump.h), read whole at
/// opening.
///
/// Frames come in the log's own time: the first at the first SetTime, each later one when as much
/// time has passed as in the log; where the log goes back in time, at once. As long as SetTime has
/// not been called all of them may be received at once. They are stamped as in the log. Lines that
/// are not frames are counted as malformed and named in warnings().
///
/// Nothing hears what is sent: Send accepts it and forgets it, and is_replay() says so. Logged
/// frames that only we may send (Filter::own) were our own then: they count as echoes and are not
/// handed out. The transport is not thread-safe.
/// @throws std::runtime_error if the file cannot be read or has no frame in it.
std::unique_ptr<Transport> OpenReplay(const std::string& file, std::vector<Filter> filters);

}  // namespace plumb
