#include "cli/record.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include "cli/outputs.h"
#include "common/lcm_log_writer.h"
#include "records/record_folder.h"
#include "robot/description.h"

namespace plumb {

int Record(Process& process, const RecordFlags& flags) {
  if (process.participant()) {
    throw std::invalid_argument(
        "a run in virtual time is recorded without loss by plumb launch --log");
  }
  std::vector<std::string> inputs{process.key_file()};
  if (!flags.robot.empty()) {
    for (const std::string& file : FilesOf(LoadRobot(flags.robot))) inputs.push_back(file);
  }
  RequireNotRead({flags.log}, inputs);
  RequireLcmLog(flags.log);
  if (!flags.overwrite) RequireOverwritable(flags.log, "");
  Messenger& messenger = process.messenger();
  // First, for what is refused: what an earlier log has is not lost for it.
  RecordFolder folder(flags.log,
                      {VersionLine("plumb"), flags.command, flags.note, "real", flags.robot});
  LcmLogWriter log(flags.log);
  std::exception_ptr failure;
  int64_t messages = 0;
  const auto all =
      messenger.Subscribe(".*", [&](const std::string& channel, std::span<const uint8_t> message) {
        if (failure) return;  // nothing is written behind half a message
        try {
          log.Write(process.clock().Utime(), channel, message);
          folder.Hear(channel, message);
          ++messages;
        } catch (...) {
          failure = std::current_exception();
        }
      });
  spdlog::info("recording to {}", flags.log);
  while (process.Wait(1'000'000) && !failure) {
  }
  messenger.DrainForGood();
  if (failure) std::rethrow_exception(failure);
  log.Flush();
  spdlog::info("{} messages in {}", messages, flags.log);
  return 0;
}

}  // namespace plumb
