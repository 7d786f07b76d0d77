#include "cli/request.h"

#include <iostream>

#include "plumb/driver_request_t.hpp"
#include "plumb/driver_status_t.hpp"

namespace plumb {
namespace {

constexpr int64_t kPatience = 3'000'000;  // [us]
constexpr int64_t kAgain = 100'000;       // [us]

bool Moves(const driver_status_t& status) {
  return status.state == driver_status_t::ARMED || status.state == driver_status_t::ARMING;
}

int Fail(const std::string& why) {
  std::cerr << "plumb: " << why << std::endl;
  return 1;
}

}  // namespace

int RequestDriver(Process& process, int8_t what) {
  Messenger& messenger = process.messenger();
  Publisher<driver_request_t> requests(messenger, "DRIVER_REQUEST");
  const bool arming = what == driver_request_t::ARM || what == driver_request_t::ARM_HOMED;
  // A stop goes on whoever else speaks in the driver's name: what counts is the answer to it.
  Subscriber<driver_status_t> statuses(messenger, "DRIVER_STATUS", {},
                                       arming ? Speakers::kOne : Speakers::kSeveral);
  driver_request_t request{};
  request.request = what;
  request.utime = process.clock().Utime();
  request.identity = messenger.identity().sender();
  bool asked = false;
  const int64_t deadline = process.clock().Now() + kPatience;
  do {
    const bool heard = statuses.received() > 0;
    // In a run with a scaled clock the driver's time is not ours.
    if (heard) request.utime = statuses.newest().utime + 1;
    if (arming && heard && statuses.newest().commands_signed && process.key_file().empty()) {
      return Fail(
          "the driver obeys signed requests only: --key FILE, with the key that it was given");
    }
    if (!arming || (heard && !asked)) {
      requests.Publish(request);
      asked = true;
    }
    if (!process.Wait(kAgain)) return 130;
    if (statuses.received() == 0) continue;
    const driver_status_t& status = statuses.newest();
    if (status.answered != request.identity) continue;
    if (arming && status.state == driver_status_t::ARMED) {
      std::cout << "armed" << std::endl;
      return 0;
    }
    if (arming && !Moves(status)) return Fail("not armed: " + status.reason);
    if (!arming && !Moves(status)) {
      std::cout << "not armed: " << status.reason << std::endl;
      return 0;
    }
  } while (process.clock().Now() < deadline);
  if (statuses.received() == 0) {
    return Fail("no driver answers on " + process.lcm_url() +
                (statuses.refused() > 0 ? ": what is heard is not signed with this key" : ""));
  }
  const driver_status_t& status = statuses.newest();
  return Fail(status.answered == request.identity
                  ? "the driver did not obey: " + status.reason
                  : "a driver is heard on " + process.lcm_url() +
                        ", but it has not answered this request" +
                        (status.reason.empty() ? "" : ": " + status.reason));
}

}  // namespace plumb
