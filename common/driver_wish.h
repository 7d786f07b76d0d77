#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "plumb/driver_request_t.hpp"
#include "plumb/driver_status_t.hpp"

namespace plumb {

/// A person's wish to the driver, until the driver has answered it: a stop goes out at once and
/// again and again; arming is asked for once, when the driver has been heard, because one wish must
/// not be granted later than it was made. Knows no sockets; time is an argument. Not thread-safe.
class DriverWish {
 public:
  static constexpr int64_t kPatience = 3'000'000;  ///< [us] until it counts as not answered
  static constexpr int64_t kAgain = 100'000;       ///< [us] between two Ticks

  struct Answer {
    bool granted;
    std::string text;  ///< "armed", "not armed: ...", "no driver answers", ...
  };

  /// @param request a constant of driver_request_t.
  /// @param identity a random number, another one for each wish. @param utime, now the moment, by
  /// the run's clock and monotonic [us].
  /// @param has_key whether what we say is signed.
  DriverWish(int8_t request, int64_t identity, int64_t utime, int64_t now, bool has_key);

  bool arms() const;
  /// Call at once, and then every kAgain. @return what is to be said now.
  std::optional<driver_request_t> Tick();
  /// A status that is to be believed.
  void OnStatus(const driver_status_t& status);
  /// None yet while the driver may still answer. @param unbelieved statuses have been heard that
  /// are not to be believed. @param where the driver should be, for people: LCM's URL.
  std::optional<Answer> FindAnswer(int64_t now, bool unbelieved, const std::string& where) const;

 private:
  driver_request_t request_{};
  const int64_t deadline_;
  const bool has_key_;
  bool asked_ = false;
  bool heard_ = false;
  driver_status_t status_;  // the newest, if any was heard
};

}  // namespace plumb
