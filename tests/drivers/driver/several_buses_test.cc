// A driver whose drives are on two buses, with the same ids on both.

#include <array>
#include <catch2/catch.hpp>
#include <cstring>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "tests/drivers/driver/fault.h"

namespace plumb {
namespace {

using Catch::Contains;

constexpr char kBusOff[] = "20000040#0000000000000000", kRestarted[] = "20000100#0000000000000000",
               kNoAck[] = "20000020#0000000000000000";

/// Nodes 1 and 2 on each of the buses left and right, in virtual time: milliseconds pass one by
/// one, the driver cycles every five. Joint 2 b + n - 1 is node n of bus b.
struct TwoBuses {
  static constexpr size_t kBuses = 2, kDrives = 2;
  struct Wire {
    std::vector<CanSimpleDevice> drives;
    bool cut = false;                  ///< nothing goes to or comes from the driver
    std::vector<Frame> frames;         ///< of the driver's last cycle
    std::map<uint32_t, int> requests;  ///< remote frames by id
  };

  TwoBuses() {
    robot = Rig(kBuses * kDrives).robot;
    robot.buses.resize(kBuses);
    for (size_t b = 0; b < kBuses; ++b) {
      robot.buses[b].name = b == 0 ? "left" : "right";
      robot.buses[b].url = "loop:" + robot.buses[b].name;
      for (size_t n = 0; n < kDrives; ++n) {
        MotorDescription& motor = robot.joints[kDrives * b + n].motor;
        motor.bus = b;
        motor.node = static_cast<int>(n) + 1;
        wires[b].drives.emplace_back(CanSimpleDevice::Settings{.node = motor.node,
                                                               .heartbeat_period = 20'000,
                                                               .encoder_period = 5'000,
                                                               .watchdog = 100'000},
                                     now);
      }
    }
    driver = std::make_unique<Driver>(robot, now, utime());
  }

  int64_t utime() const { return Rig::kEpoch + now; }
  void Step() {
    now += 1000;
    for (size_t b = 0; b < kBuses; ++b) {
      for (size_t n = 0; n < kDrives; ++n) {
        FrameBatch batch;
        wires[b].drives[n].Tick(now, {0.1 * static_cast<double>(kDrives * b + n), 0}, batch);
        for (const Frame& frame : batch.frames())
          if (!wires[b].cut) driver->OnFrame(b, frame, now, utime());
      }
    }
    while (const joint_state_t* state = driver->NextState()) states.push_back(*state);
    if (now % 5000 == 0) Cycle();
  }
  void Run(int64_t milliseconds) {
    for (int64_t i = 0; i < milliseconds; ++i) Step();
  }
  void Cycle() {
    if (commanding) {
      joint_command_t command{};
      command.utime = utime();
      command.sequence = ++sequence;
      command.episode = command.step = command.policy_iteration = -1;
      command.num_joints = kBuses * kDrives;
      command.effort = {0.1, 0.2, 0.3, 0.4};
      for (auto* none : {&command.position, &command.velocity, &command.kp, &command.kd})
        none->assign(kBuses * kDrives, std::nan(""));
      driver->OnCommand(command, now, utime());
    }
    driver->Tick(now, utime(), 0);
    std::array<int, kBuses> accepted{};
    for (size_t b = 0; b < kBuses; ++b) {
      const auto frames = driver->frames(b);
      wires[b].frames.assign(frames.begin(), frames.end());
      accepted[b] = wires[b].cut ? 0 : static_cast<int>(frames.size());
    }
    driver->Transmitted(accepted, utime());
    for (Wire& wire : wires) {
      for (const Frame& frame : wire.frames) {
        if (wire.cut) continue;
        if (frame.remote) ++wire.requests[frame.id];
        for (CanSimpleDevice& drive : wire.drives) drive.OnFrame(frame, now);
      }
    }
  }
  void Arm() {
    driver_request_t arm{};
    arm.utime = utime();
    arm.request = driver_request_t::ARM;
    driver->OnRequest(arm, now, utime());
    commanding = true;
    for (int i = 0; i < 1000 && driver->state() != DriveState::kArmed; ++i) Step();
  }
  /// Armed, all four drives with the torques of their own.
  void Bring() {
    Run(300);
    Arm();
    REQUIRE(driver->state() == DriveState::kArmed);
    Run(20);
    REQUIRE(Torques() == std::vector<double>{0.1f, 0.2f, 0.3f, 0.4f});
  }
  void Says(size_t bus, const char* text, bool foreign = false) {
    Frame frame = FrameFromText(text).value();
    frame.foreign = foreign;
    driver->OnFrame(bus, frame, now, utime());
  }
  std::vector<double> Torques() const {
    std::vector<double> torques;
    for (const Wire& wire : wires)
      for (const CanSimpleDevice& drive : wire.drives) torques.push_back(drive.Torque());
    return torques;
  }
  std::string Reason() const { return std::string(driver->reason()); }

  RobotDescription robot;
  std::array<Wire, kBuses> wires;
  std::unique_ptr<Driver> driver;
  std::vector<joint_state_t> states;
  int64_t now = 5'000'000, sequence = 0;
  bool commanding = false;
};

TEST_CASE("drives with the same ids on two buses are two drives") {
  TwoBuses two;
  two.Bring();
  for (const auto& wire : two.wires) {
    std::vector<uint32_t> torques;
    for (const Frame& frame : wire.frames)
      if ((frame.id & 0x1F) == 0x0E) torques.push_back(frame.id);
    CHECK(torques == std::vector<uint32_t>{0x02E, 0x04E});
  }
  const joint_state_t& state = two.states.back();
  for (size_t i = 0; i < 4; ++i) {
    CHECK(state.position[i] == Approx(0.1 * static_cast<double>(i) * 2 * M_PI).margin(1e-6));
    CHECK(state.valid[i]);
  }
  CHECK(state.effort_sent[3] == 0.4);
  two.states.clear();
  two.Run(100);
  CHECK(two.states.size() == 20);
}

TEST_CASE("each bus is asked for its own drives' telemetry, one question at a time") {
  TwoBuses two;
  two.Run(300);
  for (auto& wire : two.wires) wire.requests.clear();
  two.Run(1000);
  for (const auto& wire : two.wires) {
    // Temperatures and supply of two drives, ten times a second.
    int questions = 0;
    for (const auto& [id, count] : wire.requests) questions += count;
    CHECK(wire.requests.size() == 4);
    CHECK(questions == 40);
  }
}

TEST_CASE("whatever fails on one bus stops the drives on both, and says which bus it was") {
  struct Case {
    const char* what;
    std::function<void(TwoBuses&)> happens;
    const char* reason;
  };
  const auto [what, happens, reason] = GENERATE(values<Case>({
      {"bus-off", [](TwoBuses& two) { two.Says(1, kBusOff); },
       "bus right: the CAN controller went bus-off"},
      {"no acknowledgement",
       [](TwoBuses& two) {
         for (int i = 0; i < 17; ++i) two.Says(1, kNoAck);
       },
       "bus right: nobody on the bus acknowledges frames"},
      {"gone", [](TwoBuses& two) { two.driver->OnLink(1, LinkState::kGone); },
       "bus right: the CAN interface is gone"},
      {"second master", [](TwoBuses& two) { two.Says(1, "02E#0000803F00000000", true); },
       "bus right: second master: somebody else sends frame 0x02e to the drives"},
      {"Estop", [](TwoBuses& two) { two.Says(1, "022#", true); },
       "bus right: emergency stop from the bus"},
  }));
  INFO(what);
  TwoBuses two;
  two.Bring();
  happens(two);
  CHECK(two.driver->state() == DriveState::kFault);
  CHECK(two.Reason() == reason);
  two.Run(5);
  CHECK(two.Torques() == std::vector<double>(4));
  two.Run(500);
  CHECK(two.driver->confirmed_idle());
  CHECK(two.Reason() == reason);
}

TEST_CASE("acknowledgements are counted bus by bus") {
  TwoBuses two;
  two.Bring();
  for (int i = 0; i < 16; ++i) {
    two.Says(0, kNoAck);
    two.Says(1, kNoAck);
  }
  CHECK(two.driver->state() == DriveState::kArmed);
}

TEST_CASE("fault 6: one of two buses goes down", "[fault]") {
  int64_t worst_left = 0, worst_right = 0;
  for (int64_t phase = 0; phase < 20; ++phase) {
    TwoBuses two;
    two.Bring();
    two.Run(phase);
    const int64_t begin = two.now;
    two.wires[1].cut = true;
    two.driver->OnLink(1, LinkState::kDown);
    CHECK(two.Reason() == "bus right: the CAN interface is down");
    for (int i = 0; i < 150; ++i) {
      two.Step();
      const std::vector<double> torques = two.Torques();
      if (torques[0] != 0 || torques[1] != 0) worst_left = std::max(worst_left, two.now - begin);
      if (torques[2] != 0 || torques[3] != 0) worst_right = std::max(worst_right, two.now - begin);
    }
    CHECK(two.Torques() == std::vector<double>(4));
    // It is not armed while one bus is down.
    two.Arm();
    CHECK_THAT(two.Reason(), Contains("ARM refused") && Contains("bus right: the CAN interface"));
    two.wires[1].cut = false;
    two.driver->OnLink(1, LinkState::kUp);
    two.Run(1000);
    CHECK(two.driver->state() == DriveState::kFault);
    two.Arm();
    CHECK(two.driver->state() == DriveState::kArmed);
  }
  CHECK(worst_left <= 5'000);
  CHECK(worst_right <= 105'000);
  Fault{.number = "6",
        .name = "the CAN interface of one of two buses goes down",
        .detection = "the kernel says so; on that bus the drives' watchdogs",
        .happens = {}}
      .PrintRow("stops all: bus right: the CAN interface is down",
                fmt::format("{} ms; on that bus {} ms", worst_left / 1000, worst_right / 1000));
}

TEST_CASE("a bus that takes no frames stops the other one, too") {
  TwoBuses two;
  two.Bring();
  two.wires[1].cut = true;
  two.Run(50);
  CHECK(two.driver->state() == DriveState::kFault);
  CHECK(two.Reason() == "bus right: the bus has not accepted frames in 10 cycles");
  two.Run(100);
  CHECK(two.Torques() == std::vector<double>(4));
}

TEST_CASE("that one bus is alive does not hide that the other is bus-off") {
  TwoBuses two;
  two.Run(300);
  two.wires[1].cut = true;
  two.Says(1, kBusOff);
  two.Run(100);  // frames come on the left
  two.Arm();
  CHECK_THAT(two.Reason(), Contains("ARM refused: bus right: the CAN controller is bus-off") ||
                               Contains("times): bus right: the CAN controller is bus-off"));
  two.Says(1, kRestarted);
  two.wires[1].cut = false;
  two.Run(1000);
  two.Arm();
  CHECK(two.driver->state() == DriveState::kArmed);
}

TEST_CASE("DRIVER_STATUS tells of each bus") {
  TwoBuses two;
  two.Run(300);
  two.driver->OnLink(1, LinkState::kDown);
  two.Says(0, "7FF#");
  std::array<TransportStats, 2> stats;
  stats[0] = {.sent = 10, .refused = 2, .malformed = 3, .lost = 4, .foreign = 5};
  stats[1] = {.sent = 20};
  const driver_status_t& status = two.driver->Status(two.utime(), stats, 0);
  CHECK(status.bus == "left=loop:left right=loop:right");
  REQUIRE(status.num_buses == 2);
  REQUIRE(status.buses.size() == 2);
  CHECK(status.buses[0].name == "left");
  CHECK(status.buses[0].url == "loop:left");
  CHECK(status.buses[0].up);
  CHECK_FALSE(status.buses[1].up);
  CHECK(status.buses[0].frames_sent == 10);
  CHECK(status.buses[0].frames_dropped == 6);
  CHECK(status.buses[0].frames_rejected == 1 + 3);
  CHECK(status.buses[0].frames_foreign == 5);
  CHECK(status.buses[1].frames_sent == 20);
  CHECK(status.buses[1].frames_rejected == 0);
  CHECK(status.buses[0].frames_received == status.buses[1].frames_received + 1);
}

TEST_CASE("a bus that cannot work is named") {
  RobotDescription robot = TwoBuses().robot;
  robot.joints[3].motor.node = 1;
  CHECK_THROWS_WITH(Driver(robot, 0, 0), Catch::StartsWith("bus right cannot work: CAN id"));
}

}  // namespace
}  // namespace plumb
