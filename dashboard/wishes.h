#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/driver_wish.h"
#include "dashboard/viewer.h"

namespace plumb {

/// What people at the page ask of the driver, each until it is answered. Whoever asks for what is
/// being asked for already gets the same answer. Not thread-safe.
class Wishes {
 public:
  using Request = std::function<void(const driver_request_t&)>;

  /// @param request says it to the driver. @param identity a random number. @param where see
  /// DriverWish.
  Wishes(Request request, int64_t identity, bool has_key, std::string where)
      : request_(std::move(request)),
        identity_(identity),
        has_key_(has_key),
        where_(std::move(where)) {}

  /// @param request a constant of driver_request_t. @param utime, now see DriverWish.
  void Ask(int8_t request, Viewer& viewer, const ClientMessage::Call& call, int64_t utime,
           int64_t now);
  void OnStatus(const driver_status_t& status, int64_t now);
  /// A status that is not to be believed.
  void OnUnbelieved() { unbelieved_ = true; }
  void Tick(int64_t now);
  void Leave(const Viewer& viewer);

 private:
  struct Open {
    int8_t request;
    DriverWish wish;
    int64_t again;  // when to Tick [us]
    std::vector<std::pair<Viewer*, ClientMessage::Call>> askers;
  };
  void Say(Open& open, int64_t now);
  void Answer(int64_t now);

  const Request request_;
  int64_t identity_;
  const bool has_key_;
  const std::string where_;
  bool unbelieved_ = false;  // the last status
  std::list<Open> open_;
};

/// The answer to a call of a service.
void AnswerCall(Viewer& viewer, const ClientMessage::Call& call, bool ok, std::string_view text);

}  // namespace plumb
