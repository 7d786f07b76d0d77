#pragma once

#include <cstdint>
#include <filesystem>
#include <list>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "common/atomic_file.h"
#include "common/message_type.h"

namespace plumb {

/// The messages of one type on one channel as a table: the time of reception [us] in the column
/// `received`, then a column for each number and text, "q[0]", "residual[1].scale[2]". Arrays that
/// are shorter than the longest leave the rest empty. Numbers read back to the same bits, NaN and
/// infinities as nan, inf and -inf. Measure all messages, then write all of them. Not thread-safe.
class MessageTable {
 public:
  /// More columns than anything reads, or a hostile log asks for.
  static constexpr size_t kMostColumns = 50'000;

  explicit MessageTable(const MessageType& type) : type_(type) {}

  /// @return whether it decodes.
  bool Measure(std::span<const uint8_t> message);
  /// Whether its messages have more columns than there may be.
  bool too_wide() const { return too_wide_; }
  size_t columns() const { return columns_.size(); }
  int64_t rows() const { return rows_; }

  /// Begins the file. @throws std::runtime_error naming it, as all that follows, if it cannot be
  /// written.
  void Open(const std::filesystem::path& file);
  bool open() const { return file_.has_value(); }
  /// @param message is left out if it does not decode. @param received [us]
  void Write(int64_t received, std::span<const uint8_t> message);
  void Finish();

 private:
  const MessageType& type_;
  std::list<std::string> columns_;
  std::unordered_map<std::string, std::list<std::string>::iterator> places_;
  std::unordered_map<std::string, size_t> numbers_;  // of the columns, once they are all known
  bool too_wide_ = false;
  int64_t rows_ = 0;
  std::vector<std::string> cells_;
  std::optional<AtomicFile> file_;
};

}  // namespace plumb
