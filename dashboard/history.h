#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>

namespace plumb {

/// What a topic has said so far, for those who come late: of each iteration and update its newest
/// message, of what has none the newest messages, without repetitions. Bounded. Not thread-safe.
class History {
 public:
  static constexpr size_t kMaxMessages = 500;  ///< that have no iteration
  static constexpr size_t kMaxSteps = 5000;    ///< that have one
  static constexpr size_t kMaxBytes = size_t{16} << 20;

  /// Of a message: its fields `iteration` and `update`, 0 where there is only one of them.
  struct Step {
    int64_t iteration = 0, update = 0;
    auto operator<=>(const Step&) const = default;
  };
  struct Entry {
    uint64_t order;  ///< of arrival, among all topics
    int64_t utime;
    std::optional<Step> step;
    std::shared_ptr<const std::string> json;
  };

  /// A message in the order of arrival. An iteration that goes back begins a new run: what was
  /// before is forgotten.
  void Add(Entry entry);
  /// In order of arrival.
  const std::deque<Entry>& entries() const { return entries_; }

 private:
  std::deque<Entry> entries_;
  size_t bytes_ = 0;
};

}  // namespace plumb
