#include "common/driver_wish.h"

#include <limits>

namespace plumb {
namespace {

bool Moves(const driver_status_t& status) {
  return status.state == driver_status_t::ARMED || status.state == driver_status_t::ARMING;
}

}  // namespace

DriverWish::DriverWish(int8_t request, int64_t identity, int64_t utime, int64_t now, bool has_key)
    : deadline_(now + kPatience), has_key_(has_key) {
  request_.request = request;
  request_.identity = identity;
  request_.utime = utime;
}

bool DriverWish::arms() const {
  return request_.request == driver_request_t::ARM ||
         request_.request == driver_request_t::ARM_HOMED;
}

std::optional<driver_request_t> DriverWish::Tick() {
  // In a run with a scaled clock the driver's time is not ours.
  if (heard_ && status_.utime < std::numeric_limits<int64_t>::max())
    request_.utime = status_.utime + 1;
  if (arms()) {
    if (asked_ || !heard_ || (status_.commands_signed && !has_key_)) return std::nullopt;
    asked_ = true;
  }
  return request_;
}

void DriverWish::OnStatus(const driver_status_t& status) {
  heard_ = true;
  status_ = status;
}

std::optional<DriverWish::Answer> DriverWish::FindAnswer(int64_t now, bool unbelieved,
                                                         const std::string& where) const {
  if (arms() && heard_ && status_.commands_signed && !has_key_) {
    return Answer{
        false, "the driver obeys signed requests only: --key FILE, with the key that it was given"};
  }
  const bool answered = heard_ && status_.answered == request_.identity;
  if (answered && arms()) {
    if (status_.state == driver_status_t::ARMED) return Answer{true, "armed"};
    if (!Moves(status_)) return Answer{false, "not armed: " + status_.reason};
  } else if (answered && !Moves(status_)) {
    return Answer{true, "stopped; not armed: " + status_.reason};
  }
  if (now < deadline_) return std::nullopt;
  if (!heard_) {
    return Answer{false, "no driver answers on " + where +
                             (unbelieved ? ": what is heard is not signed with this key" : "")};
  }
  if (answered) return Answer{false, "the driver did not obey: " + status_.reason};
  return Answer{false, "a driver is heard on " + where + ", but it has not answered this request" +
                           (status_.reason.empty() ? "" : ": " + status_.reason)};
}

}  // namespace plumb
