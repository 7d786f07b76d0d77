#include "chaos/operator.h"

#include <fmt/format.h>

#include "plumb/policy_t.hpp"

namespace plumb {
namespace {

constexpr int64_t kArmAgain = 500'000;  // [us]

}  // namespace

Operator::Operator(Messenger& messenger)
    : requests_(messenger, "DRIVER_REQUEST"),
      drivers_(messenger, "DRIVER_STATUS"),
      controllers_(messenger, "CONTROLLER_STATUS") {}

void Operator::KeepArmed(int64_t now) {
  const int8_t state = drivers_.newest().state;
  const bool down = drivers_.received() > 0 &&
                    (state == driver_status_t::IDLE || state == driver_status_t::FAULT);
  if (!down || now < asked_ + kArmAgain) return;
  asked_ = now;
  Request(now, driver_request_t::ARM);
}

void Operator::Request(int64_t now, int8_t what) {
  driver_request_t request{};
  request.utime = now;
  request.request = what;
  requests_.Publish(request);
}

bool Operator::Finished(int iteration) const {
  const controller_status_t& status = controllers_.newest();
  return controllers_.received() > 0 && status.phase == controller_status_t::COMPLETE &&
         status.purpose == policy_t::EVALUATE && status.policy_iteration == iteration;
}

std::string Operator::Situation() const {
  return fmt::format("the driver's state is {} ({}), the controller's phase {} ({}) with policy {}",
                     int{drivers_.newest().state}, drivers_.newest().reason,
                     int{controllers_.newest().phase}, controllers_.newest().reason,
                     controllers_.newest().policy_iteration);
}

}  // namespace plumb
