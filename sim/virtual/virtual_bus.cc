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
    std::vector<FrameBatch> out(driver_.num_buses());
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
    ToRobot(to_robot_.front().bus, to_robot_.front().frame);
  }
  for (; !to_driver_.empty() && to_driver_.front().arrival <= now_; to_driver_.pop_front()) {
    ToDriver(to_driver_.front().bus, to_driver_.front().frame);
  }
}

void VirtualBus::Cycle() {
  next_cycle_ += driver_.cycle();
  on_cycle();
  driver_.Tick(now_, utime(), 0);
  std::vector<int> accepted;
  accepted.reserve(driver_.num_buses());
  for (size_t bus = 0; bus < driver_.num_buses(); ++bus)
    accepted.push_back(static_cast<int>(driver_.frames(bus).size()));
  driver_.Transmitted(accepted, utime());
  for (size_t bus = 0; bus < driver_.num_buses(); ++bus) {
    for (const Frame& frame : driver_.frames(bus)) {
      on_frame(frame);
      if (wire_.to_robot == 0) {
        ToRobot(bus, frame);
      } else {
        to_robot_.push_back({now_ + wire_.to_robot, bus, frame});
      }
    }
  }
}

void VirtualBus::ToRobot(size_t bus, const Frame& frame) {
  std::vector<FrameBatch> answers(driver_.num_buses());
  robot_.Receive(bus, frame, utime(), answers);
  FromRobot(answers);
}

void VirtualBus::ToDriver(size_t bus, const Frame& frame) {
  driver_.OnFrame(bus, frame, now_, utime());
}

void VirtualBus::FromRobot(std::span<const FrameBatch> batches) {
  for (size_t bus = 0; bus < batches.size(); ++bus) {
    for (const Frame& frame : batches[bus].frames()) {
      on_frame(frame);
      if (wire_.to_driver == 0) {
        ToDriver(bus, frame);
      } else {
        to_driver_.push_back({now_ + wire_.to_driver, bus, frame});
      }
    }
  }
}

}  // namespace plumb
