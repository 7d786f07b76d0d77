#pragma once

#include <signal.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/child.h"
#include "common/clock.h"
#include "common/messenger.h"
#include "common/signature.h"
#include "controller/policy.h"
#include "drivers/can/transport.h"
#include "plumb/controller_status_t.hpp"
#include "plumb/driver_request_t.hpp"
#include "plumb/driver_status_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "robot/description.h"

namespace plumb {

/// A file's contents; empty if there is none.
std::string Read(const std::filesystem::path& file);

/// Real processes on a bus and an LCM port of their own, and a witness who listens to both. Every stage has a
/// number of its own, so that tests run side by side. The bus is $PLUMBLINE_TEST_BUS where that is set.
class Stage {
 public:
  /// @param robot_file folder or TOML file in robots/
  explicit Stage(int number, const std::string& robot_file = "pendulum")
      : lcm_url("udpm://239.255.76.67:" + std::to_string(17700 + number) + "?ttl=0&recv_buf_size=2097152"),
        bus_url(Environment("PLUMBLINE_TEST_BUS", "udp:239.74.163.2:" + std::to_string(43200 + number))),
        robot_folder(Environment("PLUMBLINE_SOURCE", ".") + "/robots/" + robot_file),
        robot(LoadRobot(robot_folder)),
        messenger(lcm_url),
        bus(OpenTransport(bus_url)),
        drivers(messenger, "DRIVER_STATUS"),
        controllers(messenger, "CONTROLLER_STATUS"),
        commands(messenger, "JOINT_COMMAND",
                 [this](const joint_command_t& command) {
                   last_command = RealUtime();
                   last_command_made = command.utime;
                 }),
        states(messenger, "ROBOT_STATE", [this](const robot_state_t&) { last_state = RealUtime(); }),
        requests_(messenger, "DRIVER_REQUEST"),
        policies_(messenger, "POLICY") {
    folder = std::filesystem::temp_directory_path() /
             ("plumbline_stage_" + std::to_string(number) + "_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder);
  }
  /// A machine may stall for a moment, which stops a robot, as it should. Where that is not what is tested: a robot
  /// that waits longer.
  void Forgive() {
    namespace fs = std::filesystem;
    const fs::path given = robot_folder, file = fs::is_directory(given) ? given / "robot.toml" : given;
    robot_folder = folder / "robot.toml";
    std::ofstream(robot_folder) << "extends = " << file << "\n[robot]\nurdf = " << file.parent_path() / "robot.urdf"
                                << "\n[driver]\nstale_after = 0.3\ndisarm_after = 0.6\n[virtual_robot]\nwatchdog = 0.5\n";
  }
  ~Stage() {
    children.clear();
    std::error_code error;
    std::filesystem::remove_all(folder, error);
  }

  static std::string Environment(const char* name, const std::string& fallback) {
    const char* value = std::getenv(name);
    return value && *value ? value : fallback;
  }
  static std::string Binary(const std::string& name) { return Environment("PLUMBLINE_BUILD", "build") + "/bin/" + name; }
  static int64_t RealUtime() { return Clock().Utime(); }

  /// Starts one of our processes with the robot, the LCM URL and these arguments.
  Child& Start(const std::string& name, std::vector<std::string> arguments = {}) {
    arguments.insert(arguments.begin(), {Binary(name), robot_folder, "--lcm-url", lcm_url, "--parent",
                                         std::to_string(getpid())});
    children.erase(name);
    return *children.emplace(name, std::make_unique<Child>(name, arguments, folder / (name + ".log"))).first->second;
  }
  void StartDriver() {
    std::vector<std::string> arguments{"--bus", bus_url, "--virtual", "--flight-recorder", folder / "faults"};
    arguments.insert(arguments.end(), key_arguments_.begin(), key_arguments_.end());
    Start("plumb-driver", arguments);
  }
  void StartRobotAndDriver() {
    Start("plumb-robot", {"--bus", bus_url, "--seed", "1"});
    StartDriver();
  }
  void StartAll() {
    StartRobotAndDriver();
    Start("plumb-estimator");
    Start("plumb-controller", key_arguments_);
  }
  /// From now on the driver wants, and the controller and Request give, signatures with a new key. @return
  /// its file.
  std::filesystem::path UseKey() {
    const std::filesystem::path file = folder / "key";
    MakeKeyFile(file);
    key_arguments_ = {"--key", file};
    signer_.emplace(SigningKey(file), "DRIVER_REQUEST");
    return file;
  }
  std::string Log(const std::string& name) { return children.at(name)->Tail(20); }

  /// Listens for a while. Keeps what the witness on the bus saw.
  void Listen(double seconds) {
    WaitUntil([] { return false; }, seconds);
  }
  /// Listens until something is so. @return whether it came to be in time.
  bool WaitUntil(const std::function<bool()>& so, double seconds) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    for (;;) {
      messenger.lcm().handleTimeout(2);
      messenger.Drain();
      Witness();
      if (so()) return true;
      if (std::chrono::steady_clock::now() > deadline) return false;
    }
  }
  bool WaitForDriver(int8_t state, double seconds) {
    return WaitUntil([&] { return drivers.received() > 0 && drivers.newest().state == state; }, seconds);
  }

  void Request(int8_t what) {
    driver_request_t request{};
    request.utime = RealUtime();
    request.request = what;
    if (signer_) signer_->Sign(request, RealUtime());
    requests_.Publish(request);
  }
  /// Deliberately arms, as a person would: again if it was too early. @return whether it is armed.
  bool Arm(double seconds = 10) {
    int64_t asked = 0;
    return WaitUntil(
        [&] {
          if (drivers.received() == 0) return false;
          const int8_t state = drivers.newest().state;
          if (state == driver_status_t::ARMED) return true;
          if (state != driver_status_t::ABSENT && state != driver_status_t::ARMING && RealUtime() - asked > 500'000) {
            Request(driver_request_t::ARM);
            asked = RealUtime();
          }
          return false;
        },
        seconds);
  }
  /// A policy that always commands half the greatest effort.
  void PublishPolicy(int iteration = 0) {
    GaussianPolicy policy(PolicyShape{3, {4}, 1});
    policy.parameters(policy.parameters.size() - 2) = 0.5f;
    policy.action_scale.setConstant(static_cast<float>(robot.joints[0].effort_limit));
    policy_t message = policy.ToMessage();
    message.utime = RealUtime();
    message.iteration = iteration;
    message.purpose = policy_t::EVALUATE;
    message.episodes = 1000;
    policies_.Publish(message);
  }
  /// Arms and has a policy run until there is a torque on the bus and stays there. As the trainer it says the policy again
  /// and again; as a person it arms again what a busy machine has stopped on the way.
  bool BeginEpisode() {
    for (int attempt = 0; attempt < 15; ++attempt) {
      torque = 0;
      if (!Arm()) return false;
      PublishPolicy();
      if (!WaitUntil([&] { return torque != 0 || drivers.newest().state == driver_status_t::FAULT; }, 2)) continue;
      Listen(0.3);
      if (torque != 0) return true;
    }
    return false;
  }
  /// Brings everything up to an episode with a torque on the bus.
  void RunWithTorque() {
    StartAll();
    REQUIRE(WaitUntil([&] { return controllers.received() > 0; }, 20));
    const bool moving = BeginEpisode();
    INFO("driver: " << int{drivers.newest().state} << " " << drivers.newest().reason << "; controller: "
                    << int{controllers.newest().phase} << " " << controllers.newest().reason);
    REQUIRE(moving);
  }

  // What the witness saw on the bus, node 1: newest torque setpoint [Nm], axis state, times [us].
  float torque = 0;
  int axis_state = 0;
  int64_t last_torque_time = 0;  ///< of the last frame that asked for torque
  int64_t longest_alone = 0;     ///< that a torque was asked for after the last command had been made
  int64_t frames = 0;
  std::map<uint32_t, int64_t> frames_by_id;  ///< standard data frames

  std::string lcm_url, bus_url, robot_folder;
  RobotDescription robot;
  std::filesystem::path folder;
  Messenger messenger;
  std::unique_ptr<Transport> bus;
  Subscriber<driver_status_t> drivers;
  Subscriber<controller_status_t> controllers;
  Subscriber<joint_command_t> commands;
  Subscriber<robot_state_t> states;
  int64_t last_command = 0, last_state = 0;  ///< real time of reception [us]
  int64_t last_command_made = 0;             ///< its utime
  std::map<std::string, std::unique_ptr<Child>> children;

 private:
  void Witness();

  std::vector<std::string> key_arguments_;
  std::optional<Signer> signer_;
  Publisher<driver_request_t> requests_;
  Publisher<policy_t> policies_;
};

}  // namespace plumb
