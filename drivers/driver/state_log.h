#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "drivers/protocols/reason.h"

namespace plumb {

/// The changes of the driver's state on their way to the log. Noting one takes neither time nor
/// memory; they are written later, when there is time, and only while the log's descriptor takes
/// them: who reads our stderr through a pipe and stops reading must not stop the robot's torques.
/// Not thread-safe.
class StateLog {
 public:
  using Write = std::function<void(int8_t state, std::string_view reason)>;
  using WriteLost = std::function<void(int64_t changes)>;

  /// @param fd where both write to, in the end. @param lost how many changes are missing before
  /// the next that is written.
  StateLog(int fd, Write write, WriteLost lost);

  /// A state (driver_status_t) and the reason for it; nothing if they are those of the last time.
  /// The oldest of those not written makes room.
  void Note(int8_t state, std::string_view reason) noexcept;

  /// Writes what was noted, until the descriptor would make us wait.
  void Drain();

  /// True if a line can be written without waiting.
  bool ready() const noexcept;

 private:
  static constexpr size_t kCapacity = 16;

  struct Entry {
    int8_t state = -1;
    Reason reason;
  };

  int fd_;
  Write write_;
  WriteLost write_lost_;
  std::array<Entry, kCapacity> ring_;
  Entry newest_;
  size_t head_ = 0, count_ = 0;
  int64_t lost_ = 0;  // since the last that was written
};

}  // namespace plumb
