#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "drivers/can/frame.h"
#include "drivers/protocols/reason.h"
#include "robot/buses.h"

namespace plumb {

/// The latest frames on a bus, for the time after a fault. The driver's thread records and asks
/// for a dump; a thread of the recorder's own writes the file. Record and Dump do not block,
/// allocate or throw; both by one thread.
class FlightRecorder {
 public:
  /// Called by the writing thread when a file is complete, with its name, or with what went wrong.
  using Report = std::function<void(const std::string& file, const std::string& error)>;

  /// @param folder of the files, made if need be; empty = nothing is recorded. @param frames the
  /// most that are kept.
  /// @param bus whose URL is its name in the files. @throws std::runtime_error if the folder cannot
  /// be made.
  FlightRecorder(const std::filesystem::path& folder, const BusDescription& bus, size_t frames,
                 Report report);
  /// Completes the file under way.
  ~FlightRecorder();
  FlightRecorder(const FlightRecorder&) = delete;
  FlightRecorder& operator=(const FlightRecorder&) = delete;

  /// @param utime when it was received or sent [us].
  void Record(const Frame& frame, bool sent, int64_t utime) noexcept;
  /// Has all that was recorded since `since` written to folder/fault_<utime>.log, of a bus with a
  /// name to fault_<utime>_<name>.log, as candump -l writes (canplayer plays it back), each line
  /// ending in T (sent) or R (received), below a comment with the reason. Recording begins anew.
  /// @return false, and nothing happens, if the last file is still being written or nothing is
  /// recorded at all.
  bool Dump(int64_t since, int64_t utime, std::string_view reason) noexcept;

 private:
  struct Entry {
    Frame frame;
    int64_t utime;
    bool sent;
  };
  struct Tape {
    std::vector<Entry> entries;
    size_t next = 0, count = 0;
  };

  void Serve();
  void Write(const Tape& tape) const;

  std::filesystem::path folder_;
  std::string name_, bus_;
  Report report_;
  Tape tapes_[2];
  int recording_ = 0;  // the other one is the writer's while task_ is kWrite
  int64_t since_ = 0, utime_ = 0;
  Reason reason_;
  enum Task : int { kNone, kWrite, kStop };
  std::atomic<int> task_{kNone};
  std::thread writer_;
};

}  // namespace plumb
