#pragma once

#include <signal.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/child.h"
#include "common/clock.h"
#include "common/lockstep/coordinator.h"
#include "common/messenger.h"
#include "common/signature.h"
#include "drivers/can/transport.h"
#include "plumb/controller_status_t.hpp"
#include "plumb/driver_request_t.hpp"
#include "plumb/driver_status_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "plumb/policy_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "robot/description.h"
#include "tests/temporary_folder.h"

namespace plumb {

/// A file's contents; empty if there is none.
std::string Read(const std::filesystem::path& file);

/// Waits, while the run's time stands still, for something that is the machine's: a file, a foreign
/// process. Generously bounded. @return whether it came to be.
bool AwaitReally(const std::function<bool()>& so);

/// Real processes on a bus, and a witness who listens to it and to their messages. In virtual time:
/// what happens, happens at a moment, and what must follow is there to the cycle, however busy the
/// machine is. Every stage has a number of its own, so that tests run side by side. The bus is
/// $PLUMBLINE_TEST_BUS where that is set.
class Stage {
 public:
  enum class Time {
    kVirtual,
    kReal,  ///< the machine's, for the few tests that are about it
  };

  /// @param robot_file folder or TOML file in robots/
  explicit Stage(int number, const std::string& robot_file = "pendulum",
                 Time time = Time::kVirtual);
  ~Stage();

  static std::string Environment(const char* name, const std::string& fallback);
  static std::string Binary(const std::string& name);

  /// utime, by the run's clock [us].
  int64_t Now() const { return clock.Utime(); }

  /// Starts one of our processes with the robot, the run's clock and these arguments.
  Child& Start(const std::string& name, std::vector<std::string> arguments = {});
  void StartDriver();
  void StartRobotAndDriver();
  void StartAll();
  /// It is dead at this moment.
  void Kill(const std::string& name);
  /// A fault: it stands still for that long [s of virtual time], and hears afterwards what it has
  /// missed.
  void Stall(const std::string& name, double seconds);
  /// From now on the driver wants, and the controller and Request give, signatures with a new key.
  /// @return its file.
  std::filesystem::path UseKey();
  std::string Log(const std::string& name) { return children.at(name)->Tail(20); }

  /// Listens for a while. Keeps what the witness on the bus saw.
  void Listen(double seconds) {
    WaitUntil([] { return false; }, seconds);
  }
  /// Listens until something is so; looks whenever something has been heard. @return whether it
  /// came to be in time.
  bool WaitUntil(const std::function<bool()>& so, double seconds);
  bool WaitForDriver(int8_t state, double seconds);

  void Request(int8_t what);
  /// Deliberately arms, as a person would: again if it was too early. @return whether it is armed.
  bool Arm(double seconds = 10);
  /// A policy that always commands half the greatest effort.
  void PublishPolicy(int iteration = 0);
  /// Arms and has a policy run until there is a torque on the bus and stays there.
  bool BeginEpisode();
  /// Brings everything up to an episode with a torque on the bus.
  void RunWithTorque();

  // As the witness saw node 1 on the bus: newest torque setpoint [Nm], axis state, times [us].
  float torque = 0;
  int axis_state = 0;
  int64_t last_torque_time = 0;  ///< of the last frame that asked for torque
  /// that a torque was asked for after the last command had been made
  int64_t longest_alone = 0;
  int64_t frames = 0;
  std::map<uint32_t, int64_t> frames_by_id;  ///< data frames, ids of 11 and of 29 bits
  /// Called with every frame.
  std::function<void(const Frame&)> on_frame = [](const Frame&) {};
  /// Another bus, to whose frames the witness listens, too: calls `frame` with every one.
  void Hear(const std::string& url, std::function<void(const Frame&)> frame);

  std::string lcm_url, bus_url, robot_folder;
  RobotDescription robot;

 private:
  TemporaryFolder temporary_;

 public:
  const std::filesystem::path folder;
  std::optional<Coordinator> coordinator;  ///< in virtual time
  Clock clock;
  Messenger messenger;
  std::unique_ptr<Transport> bus;
  Subscriber<driver_status_t> drivers;
  Subscriber<controller_status_t> controllers;
  Subscriber<joint_command_t> commands;
  Subscriber<robot_state_t> states;
  int64_t last_command = 0, last_state = 0;  ///< when they were received [us]
  int64_t last_command_made = 0;             ///< its utime
  std::map<std::string, std::unique_ptr<Child>> children;
  std::string notes;  ///< of the coordinator

 private:
  void Witness();

  struct Ear {
    std::unique_ptr<Transport> bus;
    std::function<void(const Frame&)> on_frame;
  };

  std::vector<Ear> ears_;
  std::vector<std::string> key_arguments_;
  Publisher<driver_request_t> requests_;
  Publisher<policy_t> policies_;
};

}  // namespace plumb
