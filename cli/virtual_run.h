#pragma once

#include <exception>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "common/lcm_log_writer.h"
#include "common/lockstep/coordinator.h"
#include "common/lockstep/lcm_mirror.h"
#include "records/record_folder.h"
#include "robot/buses.h"

namespace plumb {

/// The parts of a run in virtual time that are no processes of their own: the coordinator, the
/// mirror of its messages on LCM, and its records. Not thread-safe.
class VirtualRun {
 public:
  struct Records {
    /// LCM log to write, in lcm-logger's format, with the run's times; empty: none
    std::string messages;
    RecordFolder::About about = {};          ///< what is to be said beside that log
    std::string frames = {};                 ///< CAN log to write, as candump -l does; empty: none
    std::vector<BusDescription> buses = {};  ///< whose frames are in it
  };

  /// @param folder of the run, which no other has. @param lcm_url where its messages are mirrored;
  /// memq: nowhere.
  /// @throws std::runtime_error if a file cannot be written.
  VirtualRun(const std::filesystem::path& folder, const std::string& lcm_url,
             const Records& records);
  ~VirtualRun();

  Coordinator& coordinator() { return coordinator_; }
  /// Why nobody outside sees the messages; empty if they do.
  const std::string& mirror_failure() const { return mirror_failure_; }
  /// Messages that somebody outside the run has sent on LCM since the last call.
  std::vector<LcmMirror::Message> TakeStrangers() {
    return mirror_ ? mirror_->TakeStrangers() : std::vector<LcmMirror::Message>();
  }
  /// Throws what has gone wrong with mirror or records, if something has: they have ended there,
  /// and the run, which is in the middle of something, has gone on until it looks.
  /// @throws std::runtime_error naming the file, or the channel, and the cause.
  void Rethrow();
  /// All is said. Its record is complete afterwards. @throws std::runtime_error as Rethrow.
  void Finish();

 private:
  void OnPost(const lockstep_post_t& post);
  void Record(const lockstep_post_t& post);
  void RequireFrames() const;

  Coordinator coordinator_;
  std::optional<LcmMirror> mirror_;
  std::string mirror_failure_;
  std::optional<LcmLogWriter> messages_;
  std::optional<RecordFolder> beside_messages_;
  std::string frames_file_;
  std::vector<BusDescription> buses_;
  std::ofstream frames_;
  std::exception_ptr failure_;
};

}  // namespace plumb
