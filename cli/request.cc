#include "cli/request.h"

#include <iostream>

#include "common/driver_wish.h"

namespace plumb {

int RequestDriver(Process& process, int8_t what) {
  Messenger& messenger = process.messenger();
  const Clock& clock = process.clock();
  DriverWish wish(what, messenger.identity().sender(), clock.Utime(), clock.Now(),
                  !process.key_file().empty());
  Publisher<driver_request_t> requests(messenger, "DRIVER_REQUEST");
  // A stop goes on whoever else speaks in the driver's name: what counts is the answer to it.
  Subscriber<driver_status_t> statuses(
      messenger, "DRIVER_STATUS", [&](const driver_status_t& status) { wish.OnStatus(status); },
      wish.arms() ? Speakers::kOne : Speakers::kSeveral);
  for (;;) {
    if (const auto request = wish.Tick()) requests.Publish(*request);
    if (!process.Wait(DriverWish::kAgain)) return 130;
    if (const auto answer =
            wish.FindAnswer(clock.Now(), statuses.refused() > 0, process.lcm_url())) {
      if (answer->granted) {
        std::cout << answer->text << std::endl;
      } else {
        std::cerr << "plumb: " << answer->text << std::endl;
      }
      return answer->granted ? 0 : 1;
    }
  }
}

}  // namespace plumb
