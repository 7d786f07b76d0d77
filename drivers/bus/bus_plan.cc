#include "drivers/bus/bus_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "common/special_numbers.h"
#include "drivers/bus/bus_collisions.h"
#include "drivers/bus/frame_bits.h"
#include "drivers/bus/response_time.h"
#include "drivers/protocols/registry.h"

namespace plumb {
namespace {

using Direction = BusMessage::Direction;
using Row = BusPlan::Row;

constexpr int64_t kNanoseconds = 1000;  // in a microsecond

// The order in which ids win: the 11 bits that both formats have, then standard before extended.
uint64_t Priority(const BusMessage& message) {
  const uint64_t id = message.id;
  return message.extended ? (id >> 18) << 19 | uint64_t{1} << 18 | (id & 0x3FFFF) : id << 19;
}

/// [ns] of a bit, rounded up.
int64_t BitTime(double rate) { return static_cast<int64_t>(std::ceil(1e9 / rate)); }

int64_t Cost(const Row& row) { return std::llround(row.worst_time * kNanoseconds); }

/// Of the polled messages of a direction one waits at a time: together they are one, the longest,
/// as often as all of them.
FrameTimes PolledTimes(const BusPlan& plan, Direction direction) {
  FrameTimes all{0, 0, 0};
  double rate = 0;
  for (const Row& row : plan.rows) {
    const BusMessage& message = row.message;
    if (!message.polled || message.direction != direction) continue;
    all.cost = std::max(all.cost, Cost(row));
    all.jitter = std::max(all.jitter, message.jitter * kNanoseconds);
    rate += 1 / static_cast<double>(message.period * kNanoseconds);
  }
  all.period = static_cast<int64_t>(1 / rate);
  return all;
}

void ComputeResponses(BusPlan& plan) {
  const int64_t bit = BitTime(plan.bit_rate);
  std::vector<FrameTimes> higher;
  std::map<Direction, size_t> polled;  // where in `higher`
  for (size_t i = 0; i < plan.rows.size(); ++i) {
    Row& row = plan.rows[i];
    if (row.message.period <= 0) continue;
    int64_t blocking = 0;
    for (size_t j = i + 1; j < plan.rows.size(); ++j)
      blocking = std::max(blocking, Cost(plan.rows[j]));
    row.deadline = static_cast<double>(row.message.period);
    int64_t response;
    if (row.message.polled) {
      const FrameTimes all = PolledTimes(plan, row.message.direction);
      // It must be there before the next one is asked for.
      row.deadline = static_cast<double>(all.period) / static_cast<double>(kNanoseconds);
      const auto [counted, first] = polled.try_emplace(row.message.direction, higher.size());
      if (first) higher.push_back(all);
      std::vector<FrameTimes> frames = higher;
      std::rotate(frames.begin() + static_cast<std::ptrdiff_t>(counted->second),
                  frames.begin() + static_cast<std::ptrdiff_t>(counted->second) + 1, frames.end());
      response = ResponseTime(frames, blocking, bit);
    } else {
      higher.push_back(
          {Cost(row), row.message.period * kNanoseconds, row.message.jitter * kNanoseconds});
      response = ResponseTime(higher, blocking, bit);
    }
    row.response = response < 0 ? std::numeric_limits<double>::infinity()
                                : static_cast<double>(response) / static_cast<double>(kNanoseconds);
  }
}

// An answer is queued as late as what it answers was heard. @return whether that changed anything.
bool InheritJitter(BusPlan& plan, const std::vector<BusDevice>& devices) {
  bool changed = false;
  for (Row& row : plan.rows) {
    if (row.message.answers < 0 || row.message.period <= 0) continue;
    const auto device = std::find_if(devices.begin(), devices.end(),
                                     [&](const auto& d) { return d.name == row.device; });
    const BusMessage& question = device->messages[static_cast<size_t>(row.message.answers)];
    for (const Row& other : plan.rows) {
      if (other.device != row.device || other.message.id != question.id ||
          other.message.layout.name != question.layout.name ||
          other.message.remote != question.remote ||
          other.message.direction != question.direction) {
        continue;
      }
      if (!(other.response <= static_cast<double>(row.message.period)))
        return false;  // it is an error already
      const auto jitter = static_cast<int64_t>(std::ceil(other.response));
      changed = changed || jitter != row.message.jitter;
      row.message.jitter = jitter;
    }
  }
  return changed;
}

Row MakeRow(const std::string& device, const BusMessage& message, const BusPlan& plan) {
  const int length = message.remote ? 0 : message.layout.length;
  FdBits nominal{NominalBits(message.extended, length), 0},
      worst{WorstCaseBits(message.extended, length), 0};
  if (message.fd) {
    nominal = NominalFdBits(message.extended, length);
    worst = WorstCaseFdBits(message.extended, length);
  }
  // A bus that carries no FD has an error already.
  const double fast = plan.data_bit_rate > 0 ? plan.data_bit_rate : plan.bit_rate;
  const auto time = [&](const FdBits& bits) {
    return bits.slow * 1e6 / plan.bit_rate + bits.fast * 1e6 / fast;
  };
  return {device,
          message,
          nominal.slow + nominal.fast,
          worst.slow + worst.fast,
          time(nominal),
          time(worst),
          0,
          kNaN,
          0};
}

// A controller that knows no FD takes an FD frame for an error, and destroys it.
void RequireFd(const std::vector<BusDevice>& devices, BusPlan& plan) {
  const auto with = [&](bool fd) {
    return std::ranges::find_if(devices, [&](const BusDevice& device) {
      return std::ranges::any_of(device.messages,
                                 [&](const BusMessage& message) { return message.fd == fd; });
    });
  };
  const auto fd = with(true), classic = with(false);
  if (fd == devices.end()) return;
  if (plan.data_bit_rate <= 0) {
    plan.errors.push_back(fmt::format(
        "'{}' speaks CAN FD, which the bus does not carry: [bus] data_bit_rate", fd->name));
  }
  if (classic == devices.end()) return;
  plan.warnings.push_back(fmt::format(
      "'{}' speaks CAN FD and '{}' does not: a controller that cannot stand FD destroys "
      "its frames",
      fd->name, classic->name));
}

void Judge(BusPlan& plan) {
  const int percent = static_cast<int>(std::lround(100 * plan.worst_load));
  if (plan.worst_load > 1) {
    plan.errors.push_back(
        fmt::format("the bus would be loaded to {} %: use longer periods, or two buses", percent));
  } else if (plan.worst_load > BusPlan::kWarnLoad) {
    plan.warnings.push_back(
        fmt::format("the bus is loaded to {} % at worst: above {:.0f} % nothing is left for errors "
                    "and repetitions",
                    percent, 100 * BusPlan::kWarnLoad));
  }
  for (const Row& row : plan.rows) {
    if (row.message.period <= 0 || row.response <= row.deadline) continue;
    const std::string when = std::isfinite(row.response)
                                 ? fmt::format("{:.2f} ms after it is due", row.response / 1000)
                                 : std::string("later and later");
    plan.errors.push_back(fmt::format(
        "{} of '{}' (id {:#05x}) may be sent {}, but is due every {:.2f} ms",
        row.message.layout.name, row.device, row.message.id, when, row.deadline / 1000));
  }
}

}  // namespace

BusPlan PlanBus(const std::vector<BusDevice>& devices, double bit_rate, double data_bit_rate) {
  BusPlan plan;
  plan.bit_rate = bit_rate;
  plan.data_bit_rate = data_bit_rate;
  RequireFd(devices, plan);
  // from the driver to several devices: sent once
  std::set<std::pair<uint64_t, Direction>> broadcasts;
  for (const BusDevice& device : devices) {
    for (const BusMessage& message : device.messages) {
      if (message.shared && message.direction == Direction::kToDevice &&
          !broadcasts.insert({Priority(message), message.direction}).second) {
        continue;
      }
      Row row = MakeRow(device.name, message, plan);
      if (message.period > 0) {
        const auto period = static_cast<double>(message.period);
        row.worst_load = row.worst_time / period;
        plan.worst_load += row.worst_load;
        plan.nominal_load += row.nominal_time / period;
      }
      plan.rows.push_back(row);
    }
  }
  std::stable_sort(plan.rows.begin(), plan.rows.end(), [](const Row& a, const Row& b) {
    return Priority(a.message) < Priority(b.message);
  });
  FindCollisions(devices, plan.errors, plan.warnings);
  ComputeResponses(plan);
  // Jitters only grow from round to round, up to a period.
  for (int round = 0; round < 100 && InheritJitter(plan, devices); ++round) ComputeResponses(plan);
  Judge(plan);
  return plan;
}

std::vector<BusDevice> BusDevices(const RobotDescription& robot, size_t bus) {
  std::vector<BusDevice> devices;
  for (const JointDescription& joint : robot.joints) {
    if (joint.passive || joint.motor.bus != bus) continue;
    devices.push_back(MotorBusDevice(joint.motor, robot.driver));
    devices.back().name = joint.name;
  }
  for (const SensorDescription& sensor : robot.sensors) {
    if (sensor.bus == bus) devices.push_back(SensorBusDevice(sensor));
  }
  return devices;
}

BusPlan PlanBus(const RobotDescription& robot, size_t bus) {
  const BusDescription& description = robot.buses[bus];
  return PlanBus(BusDevices(robot, bus), description.bit_rate, description.data_bit_rate);
}

std::string ToText(const BusPlan& plan) {
  std::string text =
      fmt::format("{:<10} {:<16} {:<24} {:>4} {:>9} {:>7} {:>8} {:>7} {:>9}\n", "id", "device",
                  "message", "dlc", "period ms", "bits", "load %", "from", "worst ms");
  for (const Row& row : plan.rows) {
    const BusMessage& message = row.message;
    const bool periodic = message.period > 0;
    text += fmt::format(
        "{:<10} {:<16} {:<24} {:>4} {:>9} {:>7} {:>8} {:>7} {:>9}\n",
        message.extended ? fmt::format("{:#010x}", message.id) : fmt::format("{:#05x}", message.id),
        row.device, message.layout.name, message.layout.length,
        periodic ? fmt::format("{:.2f}", static_cast<double>(message.period) / 1000) : "-",
        fmt::format("{}-{}", row.nominal_bits, row.worst_bits),
        periodic ? fmt::format("{:.2f}", 100 * row.worst_load) : "-",
        message.direction == Direction::kToDevice ? "driver" : "device",
        periodic ? fmt::format("{:.2f}", row.response / 1000) : "-");
  }
  text += fmt::format("load {:.1f} % nominal, {:.1f} % at worst, of {:g} bit/s{}\n",
                      100 * plan.nominal_load, 100 * plan.worst_load, plan.bit_rate,
                      plan.data_bit_rate > 0
                          ? fmt::format(", data of FD frames at {:g} bit/s", plan.data_bit_rate)
                          : "");
  for (const std::string& error : plan.errors) text += "error: " + error + "\n";
  for (const std::string& warning : plan.warnings) text += "warning: " + warning + "\n";
  if (plan.errors.empty()) text += "all deadlines are met\n";
  return text;
}

}  // namespace plumb
