#include "cli/rearming.h"

namespace plumb {
namespace {

constexpr int64_t kArmAgain = 500'000;  // [us]

}  // namespace

Rearming::Advice Rearming::Next(const driver_status_t& driver,
                                const controller_status_t& controller, int64_t now) {
  Advice advice;
  if (controller.num_episodes != episodes_) since_episode_ = 0;
  episodes_ = controller.num_episodes;
  if (driver.stopped_by_request != stopped_) {
    stopped_ = driver.stopped_by_request;
    if (stopped_) advice.lines.push_back("stopped by request. To go on: " + command_);
  }
  if (stopped_) return advice;
  if (driver.state == driver_status_t::FAULT && !fault_seen_) {
    fault_seen_ = true;
    const bool halted = controller.phase == controller_status_t::HALTED;
    advice.lines.push_back("driver fault: " + driver.reason +
                           (halted ? "; the controller has halted: " + controller.reason : ""));
    if (real_) {
      advice.lines.push_back("Look at the robot. To go on: " + command_);
    } else {
      ++count_, ++since_episode_;
    }
  }
  advice.give_up = since_episode_ > kMost;
  if (driver.state == driver_status_t::ARMED) fault_seen_ = false;
  const bool down = driver.state == driver_status_t::IDLE || driver.state == driver_status_t::FAULT;
  if (down && !real_ && !advice.give_up && now - last_request_ > kArmAgain) {
    advice.arm = true;
    last_request_ = now;
  }
  return advice;
}

}  // namespace plumb
