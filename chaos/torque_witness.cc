#include "chaos/torque_witness.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <stdexcept>

#include "common/decoded.h"
#include "common/seal.h"
#include "common/time_units.h"
#include "plumb/driver_request_t.hpp"
#include "plumb/driver_status_t.hpp"
#include "plumb/joint_command_t.hpp"

namespace plumb {
namespace {

// CANSimple's commands, in the last five bits of an id.
constexpr uint32_t kHeartbeat = 0x01, kEstop = 0x02, kSetAxisState = 0x07, kEstimates = 0x09,
                   kSetMode = 0x0B, kSetTorque = 0x0E;
constexpr uint32_t kEverybody = 0x3F;       // a node
constexpr uint8_t kRunning = 8;             // axis state
constexpr int64_t kRemembered = 3'000'000;  // [us]

std::optional<Frame> FrameOf(const lockstep_post_t& post) {
  if (post.topic.kind != lockstep_topic_t::FRAME) return std::nullopt;
  const auto frame =
      FrameFromText({reinterpret_cast<const char*>(post.data.data()), post.data.size()});
  if (!frame || frame->remote || frame->extended || frame->error) return std::nullopt;
  return frame;
}

float FloatAt(const Frame& frame, size_t byte) {
  float value;
  std::memcpy(&value, frame.data.data() + byte, sizeof value);
  return value;
}

template <class Item>
void Forget(std::deque<Item>& items, int64_t before) {
  const auto arrival = [](const Item& item) {
    if constexpr (std::is_same_v<Item, int64_t>) {
      return item;
    } else {
      return item.arrival;
    }
  };
  while (items.size() > 1 && arrival(items[1]) < before) items.pop_front();
}

}  // namespace

TorqueWitness::TorqueWitness(const RobotDescription& robot, Chronicle& chronicle)
    : robot_(robot),
      chronicle_(chronicle),
      cycle_(Microseconds(robot.driver.cycle)),
      expiry_(Microseconds(robot.driver.expiry)),
      stale_after_(Microseconds(robot.driver.stale_after)),
      heartbeat_timeout_(Microseconds(robot.driver.heartbeat_timeout)),
      watchdog_(Microseconds(robot.virtual_robot.watchdog)) {
  if (robot.driver.stop != DriverSettings::Stop::kZero)
    throw std::invalid_argument(robot.file + ": [driver] stop: only stops by zero are watched");
  for (const int joint : robot.driven()) {
    const JointDescription& description = robot.joints[static_cast<size_t>(joint)];
    const MotorDescription& motor = description.motor;
    if (motor.protocol != "cansimple") {
      throw std::invalid_argument(fmt::format("{}: joint {}: only motors of CANSimple are watched",
                                              robot.file, description.name));
    }
    Node node;
    node.joint = static_cast<size_t>(joint);
    node.limit = description.effort_limit / motor.gear;
    node.per_effort = motor.sign / motor.gear;
    nodes_.emplace(static_cast<uint32_t>(motor.node), std::move(node));
  }
}

void TorqueWitness::OnStart(const std::string& name) {
  stalls_[name].clear();
  if (name != "plumb-driver") return;
  commands_.clear(), stops_.clear(), arms_.clear();
  for (auto& [id, node] : nodes_) {
    node.estimates.clear(), node.heartbeats.clear();
    node.told_to_run = false;
  }
  armed_ = false;
}

void TorqueWitness::OnStall(const std::string& name, int64_t from, int64_t until) {
  stalls_[name].push_back({from, until});
}

/// When somebody hears what arrives at a time.
int64_t TorqueWitness::When(const std::string& listener, int64_t arrival) const {
  const auto stalls = stalls_.find(listener);
  if (stalls == stalls_.end()) return arrival;
  for (const Stall& stall : stalls->second)
    if (arrival >= stall.from && arrival < stall.until) arrival = stall.until;
  return arrival;
}

TorqueWitness::Node* TorqueWitness::Find(uint32_t id) {
  const auto found = nodes_.find(id >> 5);
  return found == nodes_.end() ? nullptr : &found->second;
}

void TorqueWitness::OnSaid(int64_t time, const lockstep_post_t& post, const std::string& speaker) {
  if (speaker == "plumb-driver" && post.topic.name == "DRIVER_STATUS") {
    const auto status = Decoded<driver_status_t>(post.data);
    if (!status) return;
    armed_ = status->state == driver_status_t::ARMED;
    return OnDriverState(time, armed_ || status->state == driver_status_t::ARMING);
  }
  const auto frame = FrameOf(post);
  if (!frame) return;
  Node* const node = Find(frame->id);
  if (!node) return;
  const uint32_t command = frame->id & 0x1F;
  if (speaker == "plumb-driver" && command == kSetTorque && frame->length >= 4)
    OnTorque(time, *node, FloatAt(*frame, 0));
  if (speaker == "plumb-driver" && command == kSetAxisState)
    node->told_to_run = frame->data[0] == kRunning;
  if (speaker == "plumb-robot" && command == kHeartbeat) OnDriveHeartbeat(time, *node, *frame);
}

void TorqueWitness::OnHeard(const lockstep_post_t& post, const std::string& speaker,
                            const std::string& listener, bool genuine) {
  const auto frame = FrameOf(post);
  if (listener == "plumb-robot" && frame && speaker != "plumb-robot") {
    const uint32_t node = frame->id >> 5;
    for (auto& [id, fed] : nodes_)
      if (id == node || node == kEverybody) fed.fed = std::max(fed.fed, post.arrival);
  }
  if (listener != "plumb-driver") return;
  if (frame) return OnDriverHears(*frame, post.arrival);
  if (post.topic.name == "DRIVER_REQUEST") {
    const auto request = Decoded<driver_request_t>(post.data);
    if (!request) return;
    const bool arm = request->request == driver_request_t::ARM ||
                     request->request == driver_request_t::ARM_HOMED;
    // Anybody may stop it.
    if (request->request == driver_request_t::DISARM || request->request == driver_request_t::ESTOP)
      stops_.push_back(post.arrival);
    if (arm && genuine) arms_.push_back(post.arrival);
  } else if (post.topic.name == "JOINT_COMMAND" && genuine) {
    const auto command = Decoded<joint_command_t>(post.data);
    if (!command) return;
    const bool plain = std::ranges::all_of(command->kp, [](double x) { return std::isnan(x); }) &&
                       std::ranges::all_of(command->kd, [](double x) { return std::isnan(x); });
    Forget(commands_, post.arrival - kRemembered);
    commands_.push_back({post.arrival, command->utime, command->expiry, command->effort, plain});
  }
}

void TorqueWitness::OnDriverHears(const Frame& frame, int64_t arrival) {
  const uint32_t command = frame.id & 0x1F;
  if (command == kEstop && frame.id >> 5 == kEverybody) stops_.push_back(arrival);
  Node* const node = Find(frame.id);
  if (!node) return;
  if (command == kEstimates && frame.length == 8 && std::isfinite(FloatAt(frame, 0)) &&
      std::isfinite(FloatAt(frame, 4))) {
    Forget(node->estimates, arrival - kRemembered);
    node->estimates.push_back(arrival);
  } else if (command == kHeartbeat && frame.length == 8) {
    const bool error = std::any_of(frame.data.begin(), frame.data.begin() + 4,
                                   [](uint8_t byte) { return byte != 0; });
    Forget(node->heartbeats, arrival - kRemembered);
    node->heartbeats.push_back({arrival, frame.data[4] == kRunning && !error});
  } else if (command == kEstop || command == kSetAxisState || command == kSetMode ||
             command == kSetTorque) {
    stops_.push_back(arrival);  // a second master, or a button on the bus
  }
}

void TorqueWitness::OnTorque(int64_t time, Node& node, double torque) {
  const std::string& joint = robot_.joints[node.joint].name;
  if (!std::isfinite(torque) || std::abs(torque) > node.limit * (1 + 1e-6)) {
    return chronicle_.Violate(
        1, time, fmt::format("{} Nm for {}, whose limit is {}", torque, joint, node.limit));
  }
  if (torque == 0) return;
  if (!Wanted(time, node, torque)) {
    return chronicle_.Violate(
        1, time, fmt::format("{} Nm for {}, which no fresh command wants", torque, joint));
  }
  if (const std::string why = Against(time, node); !why.empty())
    chronicle_.Violate(2, time, fmt::format("{} Nm for {}, although {}", torque, joint, why));
}

/// Whether one of the commands that may still hold asks for at least that much.
bool TorqueWitness::Wanted(int64_t time, const Node& node, double torque) const {
  return std::ranges::any_of(commands_, [&](const Command& command) {
    const int64_t heard = When("plumb-driver", command.arrival);
    const int64_t expiry = command.expiry > 0 ? std::min(command.expiry, expiry_) : expiry_;
    if (heard > time || heard < time - expiry - cycle_) return false;
    if (dates_agree_ && std::abs(heard - command.utime) > expiry_) return false;
    if (node.joint >= command.effort.size() || !std::isfinite(command.effort[node.joint]))
      return false;
    if (!command.plain) return true;
    const double wish = command.effort[node.joint] * node.per_effort;
    const double rounding = 1e-6 * (1 + std::min(std::abs(wish), node.limit));
    return torque >= std::min(0.0, wish) - rounding && torque <= std::max(0.0, wish) + rounding;
  });
}

/// Why there should be no torque any more; empty if nothing is against it.
std::string TorqueWitness::Against(int64_t time, const Node& node) const {
  const auto heard = [&](int64_t arrival) { return When("plumb-driver", arrival); };
  if (!armed_) return "the driver says that it is not armed";
  int64_t estimate = std::numeric_limits<int64_t>::min(), beat = estimate;
  for (const int64_t arrival : node.estimates)
    if (heard(arrival) <= time) estimate = std::max(estimate, heard(arrival));
  if (estimate < time - stale_after_ - cycle_) return "there is no fresh encoder estimate";
  bool running = false;
  for (const Heartbeat& heartbeat : node.heartbeats) {
    if (heard(heartbeat.arrival) > time) continue;
    if (heard(heartbeat.arrival) <= time - cycle_ || beat < time - heartbeat_timeout_)
      running = heartbeat.running;
    beat = std::max(beat, heard(heartbeat.arrival));
  }
  if (beat < time - heartbeat_timeout_ - cycle_) return "there is no fresh heartbeat";
  if (!running) return "its drive says that it does not run";
  for (const int64_t stop : stops_) {
    if (heard(stop) > time - cycle_) continue;
    const bool armed_after = std::ranges::any_of(
        arms_, [&](int64_t arm) { return heard(arm) >= heard(stop) && heard(arm) <= time; });
    if (!armed_after) return "it was told to stop, and nobody has armed it since";
  }
  return "";
}

/// In the cycle in which it stops it tells all drives that it has told to run.
void TorqueWitness::OnDriverState(int64_t time, bool active) {
  if (active) return;
  for (const auto& [id, node] : nodes_) {
    if (!node.told_to_run) continue;
    chronicle_.Violate(2, time,
                       fmt::format("the driver is not armed, and has not told the drive of "
                                   "{} to stop",
                                   robot_.joints[node.joint].name));
  }
}

/// A drive that runs has been told to, lately.
void TorqueWitness::OnDriveHeartbeat(int64_t time, const Node& node, const Frame& frame) {
  if (watchdog_ <= 0 || frame.length != 8 || frame.data[4] != kRunning) return;
  const auto stalls = stalls_.find("plumb-robot");
  const bool doubtful =
      stalls != stalls_.end() && std::ranges::any_of(stalls->second, [&](const Stall& stall) {
        return time >= stall.from && time <= stall.until + 2 * watchdog_;
      });
  if (!doubtful && time - node.fed > watchdog_ + cycle_) {
    chronicle_.Violate(2, time,
                       fmt::format("the drive of {} runs {} ms after it was spoken to last",
                                   robot_.joints[node.joint].name, (time - node.fed) / 1000));
  }
}

}  // namespace plumb
