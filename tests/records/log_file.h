#pragma once

#include <string>
#include <vector>

#include "common/lcm_log_writer.h"

namespace plumb {

/// Writes an LCM log with a message of channel A for each time [us]; its data say which it is.
inline void WriteLog(const std::string& file, const std::vector<int64_t>& times,
                     const std::string& channel = "A") {
  LcmLogWriter log(file);
  for (size_t i = 0; i < times.size(); ++i) {
    const std::string data = std::to_string(i);
    log.Write(times[i], channel, {reinterpret_cast<const uint8_t*>(data.data()), data.size()});
  }
  log.Flush();
}

}  // namespace plumb
