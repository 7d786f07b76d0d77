#include "bench/realtime/chain.h"

#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>
#include <stdexcept>

#include "cli/child.h"
#include "common/clock.h"
#include "common/messenger.h"
#include "common/time_units.h"
#include "drivers/can/transport.h"
#include "drivers/protocols/cansimple.h"
#include "plumb/driver_request_t.hpp"
#include "plumb/driver_status_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "plumb/joint_state_t.hpp"
#include "robot/description.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr double kPatience = 60;             // [s] until there must be a torque
constexpr int64_t kLongest = 1'000'000'000;  // [ns] in which an answer is looked for
constexpr int kAhead = 1000;                 // encoder frames in which the next state is looked for

class Chain {
 public:
  Chain(const std::string& source, const std::string& binaries, ChainRobot robot, int priority)
      : folder_(fs::temp_directory_path() / ("plumbline_realtime_" + std::to_string(getpid()))),
        robot_(PrepareRobot(robot, source, folder_ / "robot")),
        binaries_(binaries),
        messenger_(lcm_url_),
        bus_(OpenTransport(ObservedBus())),
        statuses_(messenger_, "DRIVER_STATUS"),
        states_(messenger_, "JOINT_STATE",
                [this](const joint_state_t& s) {
                  states_heard_.push_back({s.sequence, s.position.at(0), s.velocity.at(0)});
                }),
        commands_(
            messenger_, "JOINT_COMMAND",
            [this](const joint_command_t& c) {
              if (c.episode >= 0 && c.step >= 0)
                commands_heard_.push_back({c.state_sequence, static_cast<float>(c.effort.at(0))});
            }),
        requests_(messenger_, "DRIVER_REQUEST"),
        policies_(messenger_, "POLICY") {
    // All of them before the rest of the machine, and the driver before the others.
    const std::vector<std::string> behind{"--realtime-priority",
                                          std::to_string(std::max(priority - 5, 0))};
    Start("plumb-robot", {"--seed", "1", behind[0], behind[1]});
    Start("plumb-driver", {"--virtual", "--realtime-priority", std::to_string(priority)});
    Start("plumb-estimator", behind);
    Start("plumb-controller", behind);
  }
  ~Chain() {
    for (auto& child : children_) child.Signal(SIGTERM);
    for (auto& child : children_) child.WaitFor(3);
    children_.clear();
    std::error_code error;
    fs::remove_all(folder_, error);
  }

  void WaitForTorque() {
    Listen(kPatience, [this] { return !torques_.empty() && torques_.back().value != 0; });
    if (!torques_.empty() && torques_.back().value != 0) return;
    std::string why = "no torque within a minute; the driver says: " + statuses_.newest().reason;
    for (const Child& child : children_) why += "\n" + child.name() + ": " + child.Tail(3);
    throw std::runtime_error(why);
  }

  ChainTimes Measure(double seconds) {
    Listen(0.5, [] { return false; });
    const driver_status_t before = statuses_.newest();
    states_heard_.clear(), commands_heard_.clear(), encoders_.clear(), torques_.clear();
    stops_ = 0;
    Listen(seconds, [] { return false; });
    const driver_status_t& after = statuses_.newest();
    ChainTimes times = Join();
    for (size_t i = 0; i < after.lateness.size(); ++i)
      times.lateness.push_back(after.lateness[i] - before.lateness[i]);
    times.cycles = after.cycles - before.cycles;
    times.overruns = after.overruns - before.overruns;
    times.stops = stops_;
    times.reason = reason_;
    return times;
  }

 private:
  struct State {
    int64_t sequence;
    double position, velocity;
  };
  struct Command {
    int64_t state_sequence;
    float effort;
  };
  struct EncoderFrame {
    int64_t time;  // [ns]
    double position, velocity;
  };
  struct TorqueFrame {
    int64_t time;  // [ns]
    float value;
  };

  void Start(const std::string& name, std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {binaries_ + "/" + name, robot_, "--lcm-url", lcm_url_,
                                         "--parent", std::to_string(getpid())});
    children_.emplace_back(name, arguments, folder_ / (name + ".log"));
  }

  /// Arms, and gives it something to do, whenever it is not armed, as a person would.
  void Encourage() {
    const int64_t now = clock_.Now();
    if (statuses_.received() == 0 || now - encouraged_ < 500'000) return;
    const driver_status_t& status = statuses_.newest();
    encouraged_ = now;
    if (status.state == driver_status_t::FAULT || status.state == driver_status_t::IDLE) {
      if (status.state == driver_status_t::FAULT) {
        ++stops_;
        reason_ = status.reason;
      }
      driver_request_t arm{};
      arm.utime = clock_.Utime();
      arm.request = driver_request_t::ARM;
      requests_.Publish(arm);
    }
    policy_.utime = clock_.Utime();
    policies_.Publish(policy_);
  }

  template <class So>
  void Listen(double seconds, So so) {
    const int64_t end = clock_.Now() + Microseconds(seconds);
    while (!so() && clock_.Now() < end) {
      std::array<pollfd, 2> polled{{{bus_->fd(), POLLIN, 0}, {messenger_.fd(), POLLIN, 0}}};
      poll(polled.data(), polled.size(), 10);
      messenger_.Drain();
      ReadBus();
      Encourage();
    }
  }

  void ReadBus() {
    using namespace cansimple;
    std::array<Frame, 64> frames;
    while (const int count = bus_->Receive(frames)) {
      for (const Frame& frame : std::span(frames).first(static_cast<size_t>(count))) {
        if (frame.id == (kNode << 5 | kGetEncoderEstimates.command) && !frame.remote) {
          const FieldValues v = DecodePayload(kGetEncoderEstimates, frame).value();
          encoders_.push_back({frame.receive_ns, v[0] * kTurn, v[1] * kTurn});
        } else if (frame.id == (kNode << 5 | kSetInputTorque.command)) {
          const FieldValues v = DecodePayload(kSetInputTorqueShort, frame).value();
          torques_.push_back({frame.receive_ns, static_cast<float>(v[0])});
        }
      }
    }
  }

  /// When the encoder frame of each state was on the bus.
  std::map<int64_t, int64_t> StateTimes() const {
    std::map<int64_t, int64_t> times;
    size_t next = 0;
    for (const State& state : states_heard_) {
      for (size_t i = next; i < std::min(next + kAhead, encoders_.size()); ++i) {
        if (std::abs(encoders_[i].position - state.position) > 1e-9 ||
            std::abs(encoders_[i].velocity - state.velocity) > 1e-9)
          continue;
        times[state.sequence] = encoders_[i].time;
        next = i + 1;
        break;
      }
    }
    return times;
  }

  ChainTimes Join() const {
    ChainTimes result;
    const std::map<int64_t, int64_t> measured = StateTimes();
    for (const Command& command : commands_heard_) {
      const auto state = measured.find(command.state_sequence);
      // Of the last ones, the answer may come after the end.
      if (state == measured.end() || torques_.back().time - state->second < kLongest) continue;
      ++result.commands;
      auto torque = std::ranges::upper_bound(torques_, state->second, {}, &TorqueFrame::time);
      while (torque != torques_.end() && torque->value != command.effort &&
             torque->time - state->second < kLongest)
        ++torque;
      if (torque == torques_.end() || torque->value != command.effort) {
        ++result.superseded;
      } else {
        result.answers.push_back((torque->time - state->second + 500) / 1000);
      }
    }
    return result;
  }

  static constexpr uint32_t kNode = 1;
  static constexpr double kTurn = 2 * std::numbers::pi;

  const std::string lcm_url_ = "udpm://239.255.76.67:17690?ttl=0&recv_buf_size=2097152";
  const Clock clock_;
  const fs::path folder_, robot_;
  const std::string binaries_;
  Messenger messenger_;
  std::unique_ptr<Transport> bus_;
  Subscriber<driver_status_t> statuses_;
  Subscriber<joint_state_t> states_;
  Subscriber<joint_command_t> commands_;
  Publisher<driver_request_t> requests_;
  Publisher<policy_t> policies_;
  std::vector<State> states_heard_;
  std::vector<Command> commands_heard_;
  std::vector<EncoderFrame> encoders_;
  std::vector<TorqueFrame> torques_;
  policy_t policy_ = SwingingPolicy(LoadRobot(robot_));
  int64_t encouraged_ = 0;
  int stops_ = 0;
  std::string reason_;
  std::vector<Child> children_;
};

}  // namespace

ChainTimes MeasureChain(const std::string& source, const std::string& binaries, ChainRobot robot,
                        double seconds, int priority, int load) {
  // Before there are threads.
  const Load burning(load);
  Chain chain(source, binaries, robot, priority);
  chain.WaitForTorque();
  return chain.Measure(seconds);
}

}  // namespace plumb
