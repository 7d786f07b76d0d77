#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "dashboard/foxglove.h"

namespace plumb {

/// What waits to be sent to one client, so that a slow one holds up nobody. What the newest
/// replaces anyway goes when there is no more room, the oldest first, and is counted. Not
/// thread-safe.
class Outbox {
 public:
  static constexpr size_t kMaxBytes = 4 << 20;         ///< of messages that may go
  static constexpr size_t kMaxControlBytes = 1 << 20;  ///< of answers, which may not

  enum class Kind {
    kControl,  ///< the conversation itself: never goes
    kHistory,  ///< what was before the client came; the history holds it, and no client does
    kSlow,
    kFast  ///< goes first where there is no room
  };
  struct Item {
    Kind kind;
    bool binary = true;
    uint32_t subscription = 0;
    /// [us] of the run, at which a message was said; of what is control, the time that it tells
    std::optional<int64_t> utime;
    /// which other clients get, too; of a message without its MessageHead
    std::shared_ptr<const std::string> payload;

    bool is_message() const { return kind != Kind::kControl; }
    bool tells_time() const { return !is_message() && utime; }
  };

  static constexpr int64_t kTimeStep = 5'000;  ///< [us] by which the time that is told may be late

  void Push(Item item);
  /// The run's time is this from here on [us], also where it was later before.
  void SetTime(int64_t utime);
  bool empty() const { return items_.empty(); }
  /// The next, none if there is none; before a message of a later time than was told, unless it is
  /// of history, that time as a frame of its own: Foxglove stamps what it hears with the time that
  /// it was told last.
  std::optional<Item> Pop();
  /// Nothing more of a subscription that has ended.
  void Forget(uint32_t subscription);
  /// Messages that had to go.
  int64_t dropped() const { return dropped_; }
  /// The client makes us answer and does not listen: no use in going on with it.
  bool hopeless() const { return control_bytes_ > kMaxControlBytes; }

 private:
  struct Waiting {
    Item item;  // without its payload if it is of history
    // Which may have been forgotten before a slow client fetches it: whoever came now would not
    // hear of it either.
    std::weak_ptr<const std::string> history;

    bool forgotten() const { return item.kind == Kind::kHistory && history.expired(); }
  };
  void MakeRoom();
  void Account(const Item& item, bool added);

  std::deque<Waiting> items_;
  size_t bytes_ = 0, control_bytes_ = 0;
  int64_t dropped_ = 0;
  int64_t told_ = std::numeric_limits<int64_t>::min();  // [us] the run's time
};

}  // namespace plumb
