#include "cli/request.h"

#include <iostream>
#include <optional>

#include "common/signature.h"
#include "plumb/driver_request_t.hpp"
#include "plumb/driver_status_t.hpp"

namespace plumb {

int RequestDriver(Process& process, int8_t what, const std::string& key) {
  std::optional<Signer> signer;
  if (!key.empty()) signer.emplace(SigningKey(key), "DRIVER_REQUEST");
  Publisher<driver_request_t> requests(process.messenger(), "DRIVER_REQUEST");
  Subscriber<driver_status_t> statuses(process.messenger(), "DRIVER_STATUS");
  const bool arming = what == driver_request_t::ARM || what == driver_request_t::ARM_HOMED;
  driver_request_t request{};
  request.request = what;
  request.utime = process.clock().Utime();
  bool asked = false;
  const int64_t deadline = process.clock().Now() + 3'000'000;
  do {
    const bool heard = statuses.received() > 0;
    // In a run with a scaled clock the driver's time is not ours.
    if (heard) request.utime = statuses.newest().utime + 1;
    if (arming && heard && statuses.newest().commands_signed && !signer) {
      std::cerr << "plumb: the driver obeys signed requests only: --key FILE, with the key that it "
                   "was given"
                << std::endl;
      return 1;
    }
    if (!arming || (heard && !asked)) {
      if (signer) signer->Sign(request, process.clock().SigningUtime());
      requests.Publish(request);
      asked = true;
    }
    if (!process.Wait(100'000)) return 130;
    if (!heard) continue;
    const driver_status_t& status = statuses.newest();
    if (arming && status.state == driver_status_t::ARMED) {
      std::cout << "armed" << std::endl;
      return 0;
    }
    if (!arming && status.state != driver_status_t::ARMED &&
        status.state != driver_status_t::ARMING) {
      std::cout << "not armed: " << status.reason << std::endl;
      return 0;
    }
  } while (process.clock().Now() < deadline);
  std::cerr << "plumb: "
            << (statuses.received() == 0 ? "no driver answers on " + process.lcm_url()
                                         : "the driver did not obey: " + statuses.newest().reason)
            << std::endl;
  return 1;
}

}  // namespace plumb
