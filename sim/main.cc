// plumb-robot: a virtual robot. Speaks the CAN bus as drives and sensors do, and obeys PLACE_ROBOT.
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/examples.h"
#include "common/name_lock.h"
#include "common/process.h"
#include "common/random.h"
#include "common/realtime.h"
#include "common/seed_range.h"
#include "common/time_units.h"
#include "drivers/can/transport.h"
#include "plumb/place_robot_t.hpp"
#include "robot/buses.h"
#include "sim/parameters.h"
#include "sim/tasks/task.h"
#include "sim/virtual/virtual_robot.h"

namespace plumb {
namespace {

constexpr uint32_t kStandStream = 0x5374616E;  // of random numbers; "Stan"

/// "gravity=9.8" replaces one of the hidden parameters.
void Set(const std::string& assignment, const RobotDescription& description,
         Eigen::VectorXd& physical) {
  const size_t equals = assignment.find('=');
  const std::string name = assignment.substr(0, equals);
  const int index = description.FindParameter(name);
  if (index < 0) {
    std::string known;
    for (const ParameterDescription& parameter : description.parameters)
      known += " " + parameter.name;
    throw std::invalid_argument("--set " + assignment + ": no parameter '" + name +
                                "'; the robot's are:" + known);
  }
  double value = NAN;
  if (equals != std::string::npos) {
    const char* end = assignment.data() + assignment.size();
    const auto [rest, error] = std::from_chars(assignment.data() + equals + 1, end, value);
    if (error != std::errc() || rest != end) value = NAN;
  }
  if (!std::isfinite(value))
    throw std::invalid_argument("--set " + assignment + ": expected NAME=NUMBER");
  physical[index] = value;
}

void LogTruth(const RobotDescription& description, const Eigen::VectorXd& physical, uint64_t seed) {
  std::string text;
  for (size_t i = 0; i < description.parameters.size(); ++i) {
    const ParameterDescription& parameter = description.parameters[i];
    text += fmt::format(" {} = {:.5g} {}", parameter.name, physical[static_cast<Eigen::Index>(i)],
                        parameter.unit);
  }
  spdlog::debug("seed {}:{}", seed, text);
}

/// Puts the robot where an episode may begin: a legged one stands, and not in the ground.
void Stand(const RobotDescription& description, uint64_t seed, VirtualRobot& robot) {
  Eigen::VectorXd q(description.num_positions()), v(description.num_velocities());
  Random random(seed, {kStandStream});
  MakeTask(description)->InitialState(random, q, v);
  robot.Place(0, q, v);
}

constexpr int64_t kReopenPeriod = 200'000;  // [us]

/// The robot's end of one of its buses.
struct Bus {
  /// Tries to bring it back while it is down, and says when that changes. @param now of the clock
  /// that nobody sets.
  void Watch(int64_t now) {
    if (transport->link() != LinkState::kUp && now >= next_reopen) {
      transport->Reopen();
      next_reopen = now + kReopenPeriod;
    }
    if (transport->link() == link) return;
    link = transport->link();
    spdlog::info("{} is {}", url, link == LinkState::kUp ? "up again" : "down");
  }

  std::string url;
  std::unique_ptr<Transport> transport;
  LinkState link = LinkState::kUp;
  int64_t next_reopen = 0;
};

/// The robot between its buses and PLACE_ROBOT.
class Server {
 public:
  Server(Process& process, const RobotDescription& description, const Eigen::VectorXd& physical,
         uint64_t seed)
      : process_(process),
        clock_(process.clock()),
        robot_(description, physical, clock_.Utime()),
        answers_(description.buses.size()) {
    Stand(description, seed, robot_);
    if (!process.participant()) LockDrives(description);
    for (const BusDescription& bus : description.buses) {
      buses_.push_back({bus.url, OpenTransport(bus.url, robot_.filters(buses_.size()),
                                               {process.participant(),
                                                Microseconds(description.estimator.delay)})});
      fds_.push_back(buses_.back().transport->fd());
    }
    process.messenger().Follow(description.name);
    places_.emplace(process.messenger(), "PLACE_ROBOT",
                    [this](const place_robot_t& wish) { Place(wish); });
    for (const Bus& bus : buses_) {
      for (const std::string& warning : bus.transport->warnings()) spdlog::warn("{}", warning);
    }
    spdlog::info("{} is on {}", description.name, InOneLine(description.buses));
  }

  void Run() {
    int64_t now = clock_.Utime();
    while (process_.Wait(std::min({robot_.NextEvent() - now, kReopenPeriod, UntilFrame()}), fds_)) {
      // First the time, then the frames: what arrives in between must not find the robot already
      // past it.
      now = clock_.Utime();
      Gather(now);
      // The robot's time goes on with each: one bus must not be ahead of another.
      for (const Arrival& arrival : arrivals_) {
        robot_.Receive(arrival.bus, arrival.frame, arrival.utime, answers_);
        Answer();
      }
      robot_.Advance(now, answers_);
      Answer();
      for (Bus& bus : buses_) bus.Watch(clock_.Now());
      now = clock_.Utime();
    }
  }

 private:
  /// Both would answer. What stays within a process is nobody else's.
  void LockDrives(const RobotDescription& description) {
    for (const int joint : description.driven()) {
      const MotorDescription& motor = description.joints[static_cast<size_t>(joint)].motor;
      const std::string bus = InnermostBus(description.buses[motor.bus].url);
      if (bus.starts_with("loop:")) continue;
      locks_.emplace_back(fmt::format("virtual drive {} {} on {}", motor.protocol, motor.node, bus),
                          fmt::format("another virtual robot has the drive of node {} on {}: end "
                                      "it, or give another --bus",
                                      motor.node, bus));
    }
  }

  struct Arrival {
    int64_t utime;
    size_t bus;
    Frame frame;
  };
  static constexpr int kBursts = 16;  // of frames per wake, so that a flood cannot stop time

  void Place(const place_robot_t& wish) {
    const auto vector = [](const std::vector<double>& values) {
      return Eigen::Map<const Eigen::VectorXd>(values.data(),
                                               static_cast<Eigen::Index>(values.size()));
    };
    if (!robot_.Place(wish.utime, vector(wish.q), vector(wish.v)))
      spdlog::debug("PLACE_ROBOT asks for a state that this robot cannot have");
  }

  // [us] until a transport has one by itself.
  int64_t UntilFrame() const {
    int64_t next = Transport::kNever;
    for (const Bus& bus : buses_) next = std::min(next, bus.transport->NextEvent());
    return std::max(next, clock_.Now()) - clock_.Now();
  }

  // What has come on all buses, in the order of its times.
  void Gather(int64_t now) {
    arrivals_.clear();
    for (size_t bus = 0; bus < buses_.size(); ++bus) {
      Transport& transport = *buses_[bus].transport;
      transport.SetTime(clock_.Now());
      for (int burst = 0; burst < kBursts; ++burst) {
        const int count = transport.Receive(frames_);
        if (count == 0) break;
        for (const Frame& frame : std::span(frames_).first(static_cast<size_t>(count))) {
          const int64_t at =
              frame.receive_ns == 0 ? now : clock_.UtimeFromRealtimeNs(frame.receive_ns);
          // Of one bus in the order in which it gives them, whatever clocks and faults do.
          const bool first = arrivals_.empty() || arrivals_.back().bus != bus;
          const int64_t before = first ? at : arrivals_.back().utime;
          arrivals_.push_back({std::min(std::max(before, at), now), bus, frame});
        }
      }
    }
    std::ranges::stable_sort(arrivals_, {}, &Arrival::utime);
  }

  void Answer() {
    for (size_t i = 0; i < buses_.size(); ++i) {
      if (answers_[i].size() > 0) buses_[i].transport->Send(answers_[i].frames());
      answers_[i].Clear();
    }
  }

  Process& process_;
  const Clock& clock_;
  VirtualRobot robot_;
  std::deque<NameLock> locks_;
  std::vector<Bus> buses_;
  std::vector<int> fds_;
  std::array<Frame, 32> frames_;
  std::vector<Arrival> arrivals_;
  std::vector<FrameBatch> answers_;  // of each bus
  std::optional<Subscriber<place_robot_t>> places_;
};

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  std::string robot_path;
  std::vector<std::string> buses;
  uint64_t seed = 1;
  int priority = 0;
  std::vector<std::string> assignments;
  return plumb::Run(
      "plumb-robot", "The virtual robot: hidden parameters, drives on a CAN bus", argc, argv,
      [&](CLI::App& app) {
        app.add_option("robot", robot_path, "folder or TOML file of the robot")->required();
        app.add_option("--bus", buses, "CAN bus, of several NAME=URL; default: the robot's")
            ->allow_extra_args(false);
        plumb::AddRealtimeFlag(app, priority);
        app.add_option("--seed", seed, "draws the hidden parameters")
            ->check(plumb::SeedRange())
            ->capture_default_str();
        app.add_option("--set", assignments,
                       "NAME=VALUE: this parameter is not drawn, may be repeated");
        plumb::AddExamples(app, {"plumb-robot robots/pendulum --seed 3 --bus socketcan:vcan0"});
      },
      [&](plumb::Process& process) {
        process.BecomeFast(priority);
        plumb::RobotDescription description = plumb::LoadRobot(robot_path);
        plumb::SetUrls(description.buses, buses);
        Eigen::VectorXd physical = plumb::HiddenParameters(description, seed);
        for (const std::string& assignment : assignments)
          plumb::Set(assignment, description, physical);
        plumb::LogTruth(description, physical, seed);
        plumb::Server(process, description, physical, seed).Run();
        return 0;
      });
}
