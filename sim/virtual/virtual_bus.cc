#include "sim/virtual/virtual_bus.h"

#include <algorithm>
#include <vector>

namespace plumb {

VirtualBus::VirtualBus(const RobotDescription& robot, const Eigen::VectorXd& physical,
                       const RobotDescription& driven, int64_t start, Wire wire, int64_t phase)
    : start_(start), wire_(wire), robot_(robot, physical, start), driver_(driven, 0, start) {
  driver_.set_virtual(true);
  next_cycle_ = driver_.cycle() + phase;
}

void VirtualBus::Advance(int64_t until) {
  while (now_ < until) {
    int64_t next = std::min({until, next_cycle_, robot_.NextEvent() - start_});
    for (const auto* flights : {&to_robot_, &to_driver_}) {
      if (!flights->empty()) next = std::min(next, flights->front().arrival);
    }
    now_ = std::max(now_, next);
    FrameBatch out;
    robot_.Advance(utime(), out);
    FromRobot(out);
    Deliver();
    while (const joint_state_t* state = driver_.NextState()) on_state(*state);
    while (const imu_t* imu = driver_.NextImu()) on_imu(*imu);
    if (now_ >= next_cycle_) Cycle();
  }
}

void VirtualBus::Deliver() {
  for (; !to_robot_.empty() && to_robot_.front().arrival <= now_; to_robot_.pop_front()) {
    ToRobot(to_robot_.front().frame);
  }
  for (; !to_driver_.empty() && to_driver_.front().arrival <= now_; to_driver_.pop_front()) {
    ToDriver(to_driver_.front().frame);
  }
}

void VirtualBus::Cycle() {
  next_cycle_ += driver_.cycle();
  on_cycle();
  const auto frames = driver_.Tick(now_, utime(), 0);
  const std::vector<Frame> sent(frames.begin(), frames.end());
  driver_.Transmitted(static_cast<int>(sent.size()), utime());
  for (const Frame& frame : sent) {
    on_frame(frame);
    if (wire_.to_robot == 0) {
      ToRobot(frame);
    } else {
      to_robot_.push_back({now_ + wire_.to_robot, frame});
    }
  }
}

void VirtualBus::ToRobot(const Frame& frame) {
  FrameBatch answers;
  robot_.Receive(frame, utime(), answers);
  FromRobot(answers);
}

void VirtualBus::ToDriver(const Frame& frame) { driver_.OnFrame(frame, now_, utime()); }

void VirtualBus::FromRobot(const FrameBatch& batch) {
  for (const Frame& frame : batch.frames()) {
    on_frame(frame);
    if (wire_.to_driver == 0) {
      ToDriver(frame);
    } else {
      to_driver_.push_back({now_ + wire_.to_driver, frame});
    }
  }
}

}  // namespace plumb
