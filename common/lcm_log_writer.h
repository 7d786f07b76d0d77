#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace lcm {
class LogFile;
}

namespace plumb {

/// Writes an LCM log as lcm-logger does: lcm-logplayer plays it, --log of other programs reads it.
/// Not thread-safe.
class LcmLogWriter {
 public:
  /// @throws std::runtime_error naming the file, if it cannot be written.
  explicit LcmLogWriter(std::string file);
  ~LcmLogWriter();

  /// @param utime of the message [us]. @throws std::runtime_error if the disk is full.
  void Write(int64_t utime, const std::string& channel, std::span<const uint8_t> message);
  /// What has been written is out of this process's hands. @throws std::runtime_error as Write:
  /// without this nobody would know that the last of it found no room.
  void Flush();

 private:
  [[noreturn]] void Fail() const;

  std::string file_;
  std::unique_ptr<lcm::LogFile> log_;
};

}  // namespace plumb
