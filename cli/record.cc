#include "cli/record.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <stdexcept>

#include "common/lcm_log_writer.h"

namespace plumb {

int Record(Process& process, const std::string& file) {
  if (process.participant()) {
    throw std::invalid_argument(
        "a run in virtual time is recorded without loss by plumb launch --log");
  }
  Messenger& messenger = process.messenger();
  LcmLogWriter log(file);
  std::exception_ptr failure;
  int64_t messages = 0;
  const auto all =
      messenger.Subscribe(".*", [&](const std::string& channel, std::span<const uint8_t> message) {
        try {
          log.Write(process.clock().Utime(), channel, message);
          ++messages;
        } catch (...) {
          failure = std::current_exception();
        }
      });
  spdlog::info("recording to {}", file);
  while (process.Wait(1'000'000)) {
    if (failure) std::rethrow_exception(failure);
  }
  log.Flush();
  spdlog::info("{} messages in {}", messages, file);
  return 0;
}

}  // namespace plumb
