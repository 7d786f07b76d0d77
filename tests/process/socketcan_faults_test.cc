// Faults that the kernel makes, to the real driver and the real virtual robot: on a pair of vxcan
// interfaces, a cable with the driver at one end (vx0) and the drive and the witness at the other
// (vx1). Run by tests/with-vcan.

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <regex>

#include "tests/process/stage.h"

namespace plumb {
namespace {

using Catch::Contains;

constexpr int kClosedLoop = 8, kIdle = 1;  // CANSimple axis states
constexpr char kNewCable[] =
    "ip link add dev vx0 type vxcan peer name vx1 && ip link set vx0 up && ip link set vx1 up";

/// @return false if this machine's own kernel cannot do it; in the guest it must.
bool Try(const std::string& command) {
  const bool done = std::system(command.c_str()) == 0;
  if (Stage::Environment("WITH_VCAN", "") == "uml") {
    INFO(command);
    REQUIRE(done);
  }
  return done;
}

/// robots/pendulum with more patience, for a machine that stands still now and then: what is looked
/// for must come first.
std::string PatientRobot(const Stage& stage) {
  const std::filesystem::path folder = stage.folder / "patient";
  std::filesystem::copy(stage.robot_folder, folder);
  std::string text = Read(folder / "robot.toml");
  for (const auto& [key, value] : std::map<std::string, std::string>{
           {"stale_after", "0.4"}, {"disarm_after", "0.6"}, {"watchdog", "0.3"}}) {
    text = std::regex_replace(text, std::regex("\n" + key + " *= [0-9.]+"),
                              "\n" + key + " = " + value);
  }
  std::ofstream(folder / "robot.toml") << text;
  return folder;
}

/// The driver, the virtual robot, and a controller that asks for 1 Nm every 5 ms.
struct Cable {
  explicit Cable(int number)
      : stage(number, "pendulum", Stage::Time::kReal), publisher(stage.messenger, "JOINT_COMMAND") {
    stage.robot_folder = PatientRobot(stage);
    stage.bus = OpenTransport("socketcan:vx1");
    stage.Start("plumb-robot", {"--bus", "socketcan:vx1", "--seed", "1"});
    stage.Start("plumb-driver", {"--bus", "socketcan:vx0", "--virtual"});
  }

  bool Until(const std::function<bool()>& so, double seconds) {
    return stage.WaitUntil(
        [&] {
          // not while it starts: it would mind
          commanding = commanding || In(driver_status_t::ARMED);
          if (commanding) Command();
          return so();
        },
        seconds);
  }
  void Command() {
    const int64_t now = stage.Now();
    if (now < next) return;
    next = now + 5000;
    joint_command_t command{};
    command.utime = now;
    command.sequence = ++sequence;
    command.num_joints = 1;
    command.effort = {1};
    command.position = command.velocity = command.kp = command.kd = {NAN};
    publisher.Publish(command);
    commanded = now;
  }
  const driver_status_t& Status() { return stage.drivers.newest(); }
  bool In(int8_t state) { return stage.drivers.received() > 0 && Status().state == state; }

  /// Armed by a person, with a torque on the drive's end of the cable. Again, where a busy machine
  /// has stopped it.
  bool Arm() {
    for (int attempt = 0; attempt < 10; ++attempt) {
      stage.torque = 0;
      int64_t asked = 0;
      const bool armed = Until(
          [&] {
            if (In(driver_status_t::ARMED) && stage.torque != 0 && stage.axis_state == kClosedLoop)
              return true;
            if (!In(driver_status_t::ARMED) && !In(driver_status_t::ARMING) &&
                stage.Now() - asked > 400'000) {
              stage.Request(driver_request_t::ARM);
              asked = stage.Now();
            }
            return false;
          },
          3);
      if (armed) return true;
    }
    WARN("not armed: " << Status().reason << "; torque " << stage.torque << ", axis state "
                       << stage.axis_state);
    return false;
  }
  /// Runs on for a second; a busy machine may stop it, but not every time.
  bool RunsOn() {
    for (int attempt = 0; attempt < 5; ++attempt) {
      const int64_t before = stage.frames;
      if (Arm() && !Until([&] { return !In(driver_status_t::ARMED); }, 1))
        return stage.frames > before + 200;
    }
    return false;
  }
  /// Stopped for that reason, in that time [us] since it happened, the drive idle, and not by
  /// itself back when it is over.
  void ExpectStopped(int64_t happened, int64_t within, const std::string& reason,
                     const std::string& over = "") {
    REQUIRE(Until([&] { return In(driver_status_t::FAULT); }, 5));
    const std::string said = Status().reason;
    CHECK_FALSE(said.empty());
    CHECK_THAT(said, Contains(reason));
    Until([] { return false; }, 0.4);
    if (!over.empty()) REQUIRE(std::system(over.c_str()) == 0);
    stage.bus->Reopen();
    REQUIRE(Until([&] { return stage.axis_state == kIdle; }, 5));
    const int64_t last_torque = stage.last_torque_time;
    CHECK(last_torque - happened <= within);
    Until([] { return false; }, 0.5);
    CHECK(stage.last_torque_time == last_torque);
    CHECK(stage.axis_state == kIdle);
    CHECK(In(driver_status_t::FAULT));
    if (std::getenv("PLUMBLINE_FAULT_TABLE")) {
      std::printf("| %s | %lld ms |\n", said.c_str(),
                  static_cast<long long>(last_torque - happened) / 1000);
      std::fflush(stdout);
    }
    REQUIRE(Arm());
  }

  Stage stage;
  Publisher<joint_command_t> publisher;
  int64_t next = 0, sequence = 0, commanded = 0;
  bool commanding = false;
};

TEST_CASE(
    "what the kernel does to the bus stops the robot, says why, and a person may arm it again") {
  if (!Try(kNewCable)) {
    WARN("not tested: this kernel has no vxcan");
    return;
  }
  Cable cable(42);
  REQUIRE(cable.Arm());

  // Of the end of the commands, which take a moment, too. Through the full queue ten torques still
  // go, at 64 ms each, before the first stop.
  constexpr int64_t kSoon = 600'000, kQueue = 1'500'000;  // [us]
  struct Fault {
    const char *happens, *reason, *over;
    int64_t within;
  };
  for (const auto& [happens, reason, over, within] : {
           Fault{"ip link set vx0 down", "the CAN interface is down", "ip link set vx0 up", kSoon},
           Fault{"ip link del vx0", "the CAN interface is ", kNewCable, kSoon},
           Fault{"cansend vx0 20000040#0000000000000000", "the CAN controller went bus-off",
                 "cansend vx0 20000100#0000000000000000", kSoon},
           Fault{"tc qdisc add dev vx0 root tbf rate 2kbit burst 32 limit 1600", "",
                 "tc qdisc del dev vx0 root", kQueue},
           Fault{"tc qdisc add dev vx0 root netem loss 100%",
                 "the drive went to IDLE: watchdog timer expired", "tc qdisc del dev vx0 root",
                 kSoon},
           Fault{"tc qdisc add dev vx1 root netem loss 100%", "no encoder estimate",
                 "tc qdisc del dev vx1 root", kSoon},
           Fault{"cansend vx1 02E#0000A03F", "second master: somebody else sends frame 0x02e", "",
                 kSoon},
           Fault{"cansend vx1 022#", "emergency stop from the bus", "", kSoon},
           Fault{"cansend vx1 7E2#", "emergency stop from the bus", "", kSoon},
       }) {
    INFO(happens << ": " << cable.Status().reason);
    const int64_t now = cable.stage.Now();
    REQUIRE(std::system(happens) == 0);
    cable.ExpectStopped(now, within + cable.stage.Now() - now, reason, over);
  }

  // Frames come faster than a driver that stands still reads them.
  const int64_t dropped = cable.Status().buses[0].frames_dropped, now = cable.stage.Now();
  cable.stage.children.at("plumb-driver")->Signal(SIGSTOP);
  REQUIRE(std::system("cangen vx1 -g 0 -I 03F -L 8 -n 20000 -p 10") == 0);
  const int64_t took = cable.stage.Now() - now;
  cable.stage.children.at("plumb-driver")->Signal(SIGCONT);
  REQUIRE(cable.Until([&] { return cable.In(driver_status_t::FAULT); }, 5));
  cable.ExpectStopped(now, kSoon + took, "");
  CHECK(cable.Status().buses[0].frames_dropped > dropped);
}

TEST_CASE("what a bus does every day does not stop the robot") {
  std::system("ip link del vx0 2>/dev/null");
  if (!Try(kNewCable)) {
    WARN("not tested: this kernel has no vxcan");
    return;
  }
  Cable cable(43);
  for (const char* happens :
       {"for frame in 20000004#000400000000C800 20000004#001000000000FF60 "
        "20000004#002000000000FF60 "
        "20000002#0500000000000000; do cansend vx0 $frame || exit 1; done",
        "for end in vx0 vx1; do tc qdisc add dev $end root netem loss 5% delay 1ms 500us duplicate "
        "5% "
        "reorder 10% || exit 1; done",
        // A bus of 1 Mbit/s in either direction, and another program that fills a good part of it.
        "for end in vx0 vx1; do tc qdisc replace dev $end root tbf rate 1mbit burst 32 limit 160 "
        "|| exit 1; "
        "done; "
        "cangen vx0 -g 1 -I 001 -L 8 -n 2000 -p 10 &"}) {
    REQUIRE(cable.Arm());
    INFO(happens);
    REQUIRE(std::system(happens) == 0);
    CHECK(cable.RunsOn());
    INFO(cable.Status().reason);
  }
}

}  // namespace
}  // namespace plumb
