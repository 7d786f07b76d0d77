#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

namespace plumb {

/// A message of an LCM log.
struct LcmLogEvent {
  int64_t utime = 0;  ///< of its reception [us]; any number in a hostile log
  std::string channel;
  std::vector<uint8_t> data;  ///< as it was received, its seal (common/seal.h) included
};

/// Reads an LCM log event by event, in the file's order, from anywhere in it. Not thread-safe.
class LcmLogReader {
 public:
  /// @throws std::runtime_error naming the file if it is a folder or cannot be opened.
  explicit LcmLogReader(std::string file);

  /// @return false at the end: of the file, or in the middle of an event, where a logger was
  /// killed.
  /// @throws std::runtime_error naming the file if it is no LCM log, or the byte at which it is
  /// damaged.
  bool Read(LcmLogEvent& event);
  /// The same for the event's time alone. @throws std::runtime_error as Read.
  bool Skip(int64_t& utime);

  const std::string& file() const { return file_; }
  /// Byte at which the next event begins.
  int64_t position() const { return position_; }
  /// @param position one that this file has had, or 0.
  void Seek(int64_t position);
  /// Whether the last Read or Skip has found the beginning of an event and not its end.
  bool cut_off() const { return cut_off_; }

 private:
  struct Head {
    int64_t utime;
    uint32_t channel, data;  // lengths
  };
  bool ReadHead(Head& head);
  void RequireReadable() const;

  std::string file_;
  std::ifstream stream_;
  int64_t position_ = 0;
  bool cut_off_ = false;
};

}  // namespace plumb
