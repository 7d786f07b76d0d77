// How long a torque outlives the commands, on the wire: a driver and a virtual robot on a udp bus,
// a controller that falls silent again and again for longer than `expiry` and shorter than
// `disarm_after`, and a listener with kernel time stamps.

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <optional>
#include <vector>

#include "cli/child.h"
#include "common/clock.h"
#include "common/messenger.h"
#include "common/random.h"
#include "common/time_units.h"
#include "drivers/can/transport.h"
#include "plumb/driver_request_t.hpp"
#include "plumb/driver_status_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "robot/description.h"

namespace plumb {
namespace {

/// A listener on the wire: when torque was last asked for, and when first no more.
struct Wire {
  void Listen() {
    std::array<Frame, 64> frames;
    for (int count; (count = bus->Receive(frames)) > 0;) {
      for (const Frame& frame : std::span(frames).first(static_cast<size_t>(count))) {
        if (frame.id != 0x02E || frame.length < 4) continue;  // Set_Input_Torque of node 1
        float torque;
        std::memcpy(&torque, frame.data.data(), 4);
        if (torque != 0) torque_at = frame.receive_ns / 1000, zero_at = 0;
        if (torque == 0 && zero_at == 0) zero_at = frame.receive_ns / 1000;
      }
    }
  }
  std::unique_ptr<Transport> bus;
  int64_t torque_at = 0, zero_at = 0;  // [us]
};

class Bench {
 public:
  Bench(const std::string& binaries, const std::string& robot_folder,
        const std::filesystem::path& logs)
      : robot_(LoadRobot(robot_folder)),
        messenger_(kLcm),
        statuses_(messenger_, "DRIVER_STATUS"),
        commands_(messenger_, "JOINT_COMMAND"),
        requests_(messenger_, "DRIVER_REQUEST"),
        wire_{.bus = OpenTransport(kBus)},
        processes_{
            Child("robot",
                  {binaries + "/plumb-robot", robot_folder, "--lcm-url", kLcm, "--bus", kBus},
                  logs / "robot.log"),
            Child("driver",
                  {binaries + "/plumb-driver", robot_folder, "--lcm-url", kLcm, "--bus", kBus},
                  logs / "driver.log")} {}

  /// @return [us] from the last command to the first torque frame that is zero; nothing if the
  /// robot had stopped before.
  std::optional<int64_t> Trial() {
    if (!Armed()) return {};
    const int64_t commanding = Now() + 20'000 + random_.Bits() % 5000;
    int64_t last = 0;
    wire_.torque_at = 0;
    for (int64_t next = Now(); Now() < commanding;) {
      if (Now() >= next) {
        last = Command();
        next = last + 2000;
      }
      Wait();
    }
    const auto expiry = Microseconds(robot_.driver.expiry);
    const auto disarm_after = Microseconds(robot_.driver.disarm_after);
    const int64_t silent_until = last + expiry + (disarm_after - expiry) / 3;
    const int64_t patience = last + 1'000'000;
    while (Now() < silent_until || (wire_.zero_at == 0 && Now() < patience)) Wait();
    if (wire_.torque_at < last) return {};
    return (wire_.zero_at == 0 ? patience : wire_.zero_at) - last;
  }

 private:
  static constexpr char kLcm[] = "udpm://239.255.76.67:17699?ttl=0",
                        kBus[] = "udp:239.74.163.2:23199";

  static int64_t Now() { return Clock().Utime(); }
  void Wait() {
    messenger_.Await(1);
    messenger_.Drain();
    wire_.Listen();
  }
  int64_t Command() {
    joint_command_t command{};
    command.utime = Now();
    command.sequence = ++sequence_;
    command.num_joints = robot_.num_joints();
    const auto size = static_cast<size_t>(command.num_joints);
    command.effort.assign(size, 0.3);
    command.velocity.assign(size, 0);
    // or it would be faster and faster, and its velocity limit end the torque
    command.kd.assign(size, 0.5);
    command.position.assign(size, NAN);
    command.kp.assign(size, NAN);
    commands_.Publish(command);
    return command.utime;
  }
  /// Arms where it is not; within five seconds.
  bool Armed() {
    int64_t asked = 0;
    for (const int64_t deadline = Now() + 5'000'000; Now() < deadline; Wait()) {
      if (statuses_.received() == 0) continue;
      if (statuses_.newest().state == driver_status_t::ARMED) return true;
      if (Now() - asked < 500'000) continue;
      asked = Now();
      driver_request_t request{};
      request.utime = asked;
      request.request = driver_request_t::ARM;
      requests_.Publish(request);
    }
    return false;
  }

  RobotDescription robot_;
  Messenger messenger_;
  Subscriber<driver_status_t> statuses_;
  Publisher<joint_command_t> commands_;
  Publisher<driver_request_t> requests_;
  Wire wire_;
  std::array<Child, 2> processes_;
  Random random_{1};
  int64_t sequence_ = 0;
};

int Run(const std::string& binaries, const std::string& robot_folder, int trials) {
  const std::filesystem::path logs =
      std::filesystem::temp_directory_path() / fmt::format("command_loss_{}", getpid());
  std::filesystem::create_directories(logs);
  const DriverSettings settings = LoadRobot(robot_folder).driver;
  std::vector<double> times;
  int stopped = 0;
  {
    Bench bench(binaries, robot_folder, logs);
    while (static_cast<int>(times.size()) < trials && stopped <= trials) {
      if (const auto time = bench.Trial())
        times.push_back(static_cast<double>(*time) * 1e-3);
      else
        ++stopped;
    }
  }
  std::filesystem::remove_all(logs);
  if (times.empty()) {
    fmt::print("no trial succeeded: does {}/plumb-driver run?\n", binaries);
    return 1;
  }
  std::ranges::sort(times);
  const double bound = (settings.expiry + settings.cycle) * 1e3;
  const auto percentile = [&](double p) {
    return times[static_cast<size_t>(p * static_cast<double>(times.size() - 1))];
  };
  const auto within = std::ranges::upper_bound(times, bound) - times.begin();
  fmt::print(
      "from the last command to zero torque on the wire, {} trials (before {} more the robot had "
      "stopped), "
      "expiry {} ms, "
      "cycle {} ms:\n",
      times.size(), stopped, settings.expiry * 1e3, settings.cycle * 1e3);
  fmt::print("| p50 ms | p90 ms | p99 ms | max ms | within {:g} ms |\n|---|---|---|---|---|\n",
             bound);
  fmt::print("| {:.2f} | {:.2f} | {:.2f} | {:.2f} | {} of {} |\n", percentile(0.5), percentile(0.9),
             percentile(0.99), times.back(), within, times.size());
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  CLI::App app("How long a torque outlives the commands, measured on the wire");
  std::string robot = "robots/pendulum";
  int trials = 1000;
  app.add_option("robot", robot, "robot folder; its first motor is an ODrive, node 1")
      ->capture_default_str();
  app.add_option("--trials", trials)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const auto binaries =
      std::filesystem::canonical("/proc/self/exe").parent_path().parent_path() / "bin";
  return plumb::Run(binaries, robot, trials);
}
