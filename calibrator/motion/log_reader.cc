#include "calibrator/motion/log_reader.h"

#include <span>

#include "common/lcm_log_reader.h"
#include "common/seal.h"

namespace plumb {

LogEnd ReadLog(const std::string& file,
               const std::function<bool(const std::string&, const void*, int, int64_t)>& on_event) {
  LcmLogReader log(file);
  LcmLogEvent event;
  LogEnd end;
  while (log.Read(event)) {
    ++end.events;
    const std::span<const uint8_t> message = Unsealed(event.data);
    if (!on_event(event.channel, message.data(), static_cast<int>(message.size()), event.utime))
      break;
  }
  end.cut_off = log.cut_off();
  return end;
}

}  // namespace plumb
