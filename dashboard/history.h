#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>

namespace plumb {

/// What a topic has said so far, for those who come late: of messages that differ in nothing but
/// numbers, those of one iteration and update, the first, which tells since when it is so, and the
/// newest. Bounded. Not thread-safe.
class History {
 public:
  static constexpr size_t kMaxMessages = 500;  ///< that have no iteration
  static constexpr size_t kMaxSteps = 5000;    ///< that have one
  static constexpr size_t kMaxBytes = size_t{16} << 20;

  /// Of a message: its fields `iteration` and `update`, 0 where there is only one of them.
  struct Step {
    int64_t iteration = 0, update = 0;
    auto operator<=>(const Step&) const = default;  // NOLINT(modernize-use-nullptr): no pointer
  };
  struct Entry {
    uint64_t order;  ///< of arrival, among all topics
    int64_t utime;   ///< [us] of the run
    std::optional<Step> step;
    size_t words;  ///< a hash of what it says besides numbers
    std::shared_ptr<const std::string> json;
  };

  /// A message in the order of arrival. Where a step goes back, what was said of it and of later
  /// ones is forgotten: it is said again, by a run that begins anew or goes on from there.
  void Add(Entry entry);
  /// The run has been set back to this time: what was said from then on is forgotten.
  void Rewind(int64_t utime);
  /// In order of arrival.
  const std::deque<Entry>& entries() const { return entries_; }

 private:
  std::deque<Entry> entries_;
  size_t bytes_ = 0;
};

}  // namespace plumb
