#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "dashboard/outbox.h"

namespace plumb {

/// One client of the page's WebSocket, as the gateway knows it: what it listens to, what waits for
/// it, and what it may do. Not thread-safe.
struct Viewer {
  /// @param why_not see why_not_arm. @param on_item something waits in the outbox.
  Viewer(std::string why_not, std::function<void()> on_item)
      : why_not_arm(std::move(why_not)), wake(std::move(on_item)) {}

  void Say(std::string text, bool binary = false) {
    outbox.Push({Outbox::Kind::kControl,
                 binary,
                 0,
                 {},
                 std::make_shared<const std::string>(std::move(text))});
    wake();
  }

  /// @param utime of the run [us]
  void SetTime(int64_t utime) {
    outbox.SetTime(utime);
    wake();
  }

  const std::string why_not_arm;  ///< empty: it may
  const std::function<void()> wake;
  Outbox outbox;
  std::map<uint32_t, uint32_t> subscriptions;  ///< to topics
};

}  // namespace plumb
