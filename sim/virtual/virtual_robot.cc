#include "sim/virtual/virtual_robot.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "common/time_units.h"
#include "sim/model.h"

namespace plumb {
namespace {

RobotDescription TrueRobot(const RobotDescription& description, const Eigen::VectorXd& physical) {
  return Model(description).Describe(physical);
}

}  // namespace

VirtualRobot::VirtualRobot(const RobotDescription& description, const Eigen::VectorXd& physical,
                           int64_t now)
    : space_(description),
      plant_(TrueRobot(description, physical)),
      devices_(VirtualDevices(description)),
      efforts_(description),
      unsent_(description.buses.size()) {
  for (const int joint : description.driven())
    bus_.push_back(description.joints[static_cast<size_t>(joint)].motor.bus);
  for (const SensorDescription& sensor : description.sensors) bus_.push_back(sensor.bus);
  for (const auto& device : devices_) {
    const int joint = device->joint();
    effort_index_.push_back(joint < 0 ? -1 : description.velocity_of(joint));
  }
  Boot(now);
}

void VirtualRobot::Boot(int64_t now) {
  time_ = latest_ = now;
  efforts_.Clear();
  for (const auto& device : devices_) device->Boot(Motion());
}

std::vector<Filter> VirtualRobot::filters(size_t bus) const {
  std::vector<Filter> all;
  for (size_t i = 0; i < devices_.size(); ++i) {
    if (bus_[i] != bus) continue;
    for (const Filter& filter : devices_[i]->filters()) all.push_back(filter);
  }
  return all;
}

void VirtualRobot::Receive(size_t bus, const Frame& frame, int64_t arrival,
                           std::span<FrameBatch> out) {
  Advance(arrival, out);
  bool matters = false;
  for (size_t i = 0; i < devices_.size(); ++i) {
    if (bus_[i] == bus) matters = devices_[i]->OnFrame(frame, latest_) || matters;
  }
  if (!matters) return;
  MoveTo(latest_);
  Tick(out);
}

int64_t VirtualRobot::NextEvent() const {
  int64_t next = std::numeric_limits<int64_t>::max();
  for (const auto& device : devices_) next = std::min(next, device->NextDue());
  return next;
}

void VirtualRobot::Advance(int64_t now, std::span<FrameBatch> out) {
  if (std::abs(now - latest_) > kLongestGap) Boot(now);
  latest_ = std::max(latest_, now);
  for (int64_t next = NextEvent(); next <= latest_; next = NextEvent()) {
    MoveTo(next);
    for (FrameBatch& unsent : unsent_) unsent.Clear();
    Tick(latest_ - next > kLatest ? unsent_ : out);
  }
}

void VirtualRobot::Tick(std::span<FrameBatch> out) {
  for (size_t i = 0; i < devices_.size(); ++i) {
    devices_[i]->Tick(Motion(), out[bus_[i]]);
    if (effort_index_[i] >= 0) efforts_.Make(effort_index_[i], devices_[i]->Effort(), time_);
  }
}

void VirtualRobot::MoveTo(int64_t time) {
  while (time_ < time) {
    const int64_t begin = time_, end = std::min(time, efforts_.NextChange());
    last_q_ = q();
    last_v_ = v();
    last_motor_q_ = plant_.motor_q();
    last_motor_v_ = plant_.motor_v();
    // A state that cannot be simulated (nothing sane leads there) ends in standstill, not in a
    // crash.
    if (!plant_.Advance(efforts_.acting(), Seconds(end - begin))) plant_.SetState(q(), 0 * v());
    time_ = end;
    efforts_.Take(time_);
    for (const auto& device : devices_) {
      device->Track({begin, last_q_, last_v_, last_motor_q_, last_motor_v_}, Motion());
    }
  }
}

bool VirtualRobot::Place(int64_t utime, const Eigen::Ref<const Eigen::VectorXd>& wish_q,
                         const Eigen::Ref<const Eigen::VectorXd>& wish_v) {
  const auto within_reach = [](const Eigen::Ref<const Eigen::VectorXd>& x,
                               const Eigen::VectorXd& now) {
    return x.size() == now.size() && (x.array().abs() <= kFarthest).all();  // NaN is not
  };
  if (!within_reach(wish_q, q()) || !within_reach(wish_v, v()) || !space_.Has(wish_q)) return false;
  if (utime == placed_) return true;
  placed_ = utime;
  MoveTo(latest_);
  plant_.SetState(wish_q, wish_v);
  for (const auto& device : devices_) device->Place(Motion());
  return true;
}

}  // namespace plumb
