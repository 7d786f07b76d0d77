#include "drivers/driver.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "tests/drivers/rig.h"

namespace plumb {
namespace {

using Catch::Matchers::Contains;
using Catch::Matchers::Equals;
using Catch::Matchers::StartsWith;

constexpr double kTwoPi = 2 * std::numbers::pi;

TEST_CASE("arming follows the protocol's sequence and ends in torque control") {
  Rig rig;
  rig.Start();
  rig.Run(300);
  CHECK(rig.driver->state() == DriveState::kIdle);
  rig.Request(driver_request_t::ARM);
  std::vector<std::string> all;
  for (int i = 0; i < 12; ++i) {
    rig.Run(5);
    for (const std::string& text : rig.Sent()) all.push_back(text);
  }
  CHECK(rig.driver->state() == DriveState::kArmed);
  CHECK(rig.Reason().empty());
  all.erase(std::remove(all.begin(), all.end(), "02E#0000000000000000"), all.end());
  CHECK(all == std::vector<std::string>{"020#R", "038#00", "02B#0100000001000000", "027#0800000000000000"});
  CHECK(rig.drives[0].armed());
  CHECK(rig.drives[0].Torque() == 0);
}

TEST_CASE("armed, it transmits the newest command in every cycle") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1.5));
  rig.Run(20);
  CHECK(rig.Sent() == std::vector<std::string>{"02E#0000C03F00000000"});
  CHECK(rig.drives[0].Torque() == 1.5);
  // Three commands between two cycles: only the last is ever sent.
  rig.commanding = false;
  rig.Command(1);
  rig.Command(-1);
  rig.Command(-0.5);
  const int64_t before = rig.drives[0].setpoints();
  rig.Run(5);
  CHECK(rig.drives[0].Torque() == -0.5);
  CHECK(rig.drives[0].setpoints() == before + 1);
  // One that was overtaken on its way does not come back.
  joint_command_t old = rig.MakeCommand(2);
  old.sequence -= 2;
  rig.driver->OnCommand(old, rig.now, rig.utime());
  rig.Run(5);
  CHECK(rig.drives[0].Torque() == -0.5);
  CHECK(rig.Status().commands_rejected == 1);
}

TEST_CASE("efforts are limited, geared and turned") {
  Rig rig;
  rig.robot.joints[0].motor.gear = 4;
  rig.robot.joints[0].motor.sign = -1;
  rig.robot.joints[0].motor.offset = 0.5;
  rig.robot.joints[0].lower = -1;
  rig.robot.joints[0].upper = 1;
  rig.Start();
  REQUIRE(rig.Arm(9));
  rig.samples[0] = {0, 0};  // joint at 0.5
  rig.Run(20);
  CHECK(rig.drives[0].Torque() == -0.5);  // 2 Nm at the joint
  rig.samples[0] = {-4 * 0.6 / kTwoPi, 0};  // joint at 1.1
  rig.Run(20);
  CHECK(rig.states.back().position[0] == Approx(1.1));
  CHECK(rig.drives[0].Torque() == 0);
  rig.effort = -9;
  rig.Run(20);
  CHECK(rig.drives[0].Torque() == 0.5);
  rig.samples[0] = {0, 4 * 21 / kTwoPi};  // joint at -21 rad/s: too fast
  rig.Run(20);
  CHECK(rig.drives[0].Torque() == 0);
}

TEST_CASE("silence takes the torque away, then disarms") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(50);
  REQUIRE(rig.drives[0].Torque() == 1);
  rig.commanding = false;
  int64_t to_zero = 0;
  while (rig.drives[0].Torque() != 0 && to_zero < 1000) rig.Step(), ++to_zero;
  CHECK(to_zero > 95);
  CHECK(to_zero <= 105);
  CHECK(rig.driver->state() == DriveState::kArmed);
  CHECK(rig.Status().commands_expired == 1);
  const int64_t to_fault = to_zero + rig.RunUntil(DriveState::kFault);
  CHECK(to_fault >= 250);
  CHECK(to_fault <= 260);
  CHECK_THAT(rig.Reason(), StartsWith("no command for 25"));
  rig.Run(100);
  CHECK_FALSE(rig.drives[0].armed());
  CHECK(rig.drives[0].disarm_reason() == 0);  // we disarmed it, not its watchdog
  CHECK(rig.driver->confirmed_idle());
}

TEST_CASE("a controller that never begins is silence, too") {
  Rig rig;
  rig.Start();
  rig.Run(300);
  rig.Request(driver_request_t::ARM);
  REQUIRE(rig.RunUntil(DriveState::kArmed) >= 0);
  const int64_t waited = rig.RunUntil(DriveState::kFault);
  CHECK(waited >= 245);
  CHECK(waited <= 260);
  CHECK_THAT(rig.Reason(), StartsWith("no command for"));
}

TEST_CASE("it does not arm by itself, nor again") {
  Rig rig;
  rig.Start();
  rig.commanding = false;
  rig.Run(1000);
  CHECK(rig.driver->state() == DriveState::kIdle);
  rig.Run(1);
  REQUIRE(rig.Arm());
  rig.commanding = false;
  REQUIRE(rig.RunUntil(DriveState::kFault) >= 0);
  const int64_t fault = rig.now;
  rig.commanding = true;
  rig.Run(1000);
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK_FALSE(rig.drives[0].armed());
  rig.commanding = false;
  // A wish from before the fault is not a wish to go on.
  rig.Request(driver_request_t::ARM, rig.now - fault + 1000);
  rig.Run(10);
  CHECK(rig.driver->state() == DriveState::kFault);
  rig.Request(driver_request_t::ARM);
  rig.commanding = true;
  CHECK(rig.RunUntil(DriveState::kArmed) >= 0);
}

TEST_CASE("an ARM whose maker's clock is ahead counts once") {
  Rig rig;
  rig.Start();
  rig.Run(400);
  driver_request_t arm;
  arm.utime = rig.utime() + 60'000'000;
  arm.request = driver_request_t::ARM;
  rig.driver->OnRequest(arm, rig.now, rig.utime());
  REQUIRE(rig.RunUntil(DriveState::kArmed) >= 0);
  REQUIRE(rig.RunUntil(DriveState::kFault) >= 0);
  rig.driver->OnRequest(arm, rig.now, rig.utime());
  rig.Run(10);
  CHECK(rig.driver->state() == DriveState::kFault);
}

TEST_CASE("an ARM from before the driver's start is not for it") {
  Rig rig;
  rig.Start();
  rig.Run(400);
  rig.Request(driver_request_t::ARM, 400'001);
  rig.Run(10);
  CHECK(rig.driver->state() == DriveState::kIdle);
}

TEST_CASE("the start guard") {
  Rig rig;
  rig.Start();
  rig.Run(100);
  rig.Request(driver_request_t::ARM);
  rig.Run(10);
  CHECK(rig.driver->state() == DriveState::kIdle);
  CHECK_THAT(rig.Reason(), Contains("only just started"));

  // A controller of an earlier run is still talking.
  rig.commanding = true;
  rig.effort = 1;
  rig.Run(300);
  rig.Request(driver_request_t::ARM);
  rig.Run(100);
  CHECK(rig.driver->state() == DriveState::kIdle);
  CHECK_THAT(rig.Reason(), Contains("stop the controller of an earlier run"));
  CHECK(rig.Status().commands_accepted == 0);
  CHECK(rig.Status().commands_rejected > 0);
  CHECK(rig.drives[0].setpoints() == 0);

  rig.commanding = false;
  rig.Run(260);
  CHECK(rig.Arm());
}

TEST_CASE("ARM is refused while something is missing, and says what") {
  Rig rig(2);
  bool heartbeat = false, encoder = false;
  rig.to_driver = [&](Frame& frame) {
    return (frame.id != 0x41 || heartbeat) && (frame.id != 0x49 || encoder);  // node 2
  };
  rig.Start();
  rig.Run(300);
  CHECK(rig.driver->state() == DriveState::kAbsent);
  CHECK_THAT(rig.Status().reason, Equals("knee1: no heartbeat yet"));
  rig.Request(driver_request_t::ARM);
  CHECK_THAT(rig.Reason(), Equals("ARM refused: knee1: no heartbeat yet"));
  heartbeat = true;
  rig.Run(30);
  rig.Request(driver_request_t::ARM);
  CHECK_THAT(rig.Reason(), Equals("ARM refused: knee1: no encoder estimates"));
  encoder = true;
  rig.driver->OnLink(LinkState::kDown);
  rig.Run(10);
  rig.Request(driver_request_t::ARM);
  CHECK_THAT(rig.Reason(), Contains("interface is not up"));
  rig.driver->OnLink(LinkState::kUp);
  CHECK(rig.Arm());
  CHECK(rig.drives[1].armed());
}

TEST_CASE("drives it must not arm") {
  Rig rig;
  SECTION("firmware 0.5") {
    rig.settings.version = {2, 3, 6, 56, 0, 5, 6, 0};
    rig.Start();
    CHECK_FALSE(rig.Arm());
    CHECK_THAT(rig.Reason(), Contains("its firmware is 0.5, this driver speaks 0.6"));
  }
  SECTION("no answer to the question for its version") {
    rig.to_drive = [](Frame& frame) { return frame.id != 0x20; };
    rig.Start();
    CHECK_FALSE(rig.Arm());
    CHECK_THAT(rig.Reason(), Contains("does not answer Get_Version"));
  }
  SECTION("one that stays idle") {
    rig.to_drive = [](Frame& frame) { return frame.id != 0x27 || frame.data[0] != 8; };
    rig.Start();
    CHECK_FALSE(rig.Arm());
    CHECK_THAT(rig.Reason(), Equals("pivot: it stays in IDLE (no error; success)"));
  }
  CHECK(rig.driver->state() == DriveState::kFault);
  rig.Run(200);
  CHECK_FALSE(rig.drives[0].armed());
  CHECK(rig.driver->confirmed_idle());
}

TEST_CASE("a lost version request is asked again") {
  Rig rig;
  int asked = 0;
  rig.to_drive = [&](Frame& frame) { return frame.id != 0x20 || ++asked > 3; };
  rig.Start();
  CHECK(rig.Arm());
}

TEST_CASE("a drive that stops working stops the robot, with the reason") {
  Rig rig(2);
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(50);
  const char* expected = "";
  int64_t at_most = 0;
  SECTION("watchdog in the heartbeat") {
    rig.Inject("041#0000000101030000");
    expected = "knee1: the drive went to IDLE: watchdog timer expired (disarmed)";
    at_most = 5;
  }
  SECTION("an error while in closed loop") {
    rig.Inject("041#0004000008000000");
    expected = "knee1: the drive went to CLOSED_LOOP_CONTROL: DC bus over-current (success)";
    at_most = 5;
  }
  SECTION("no encoder estimates") {
    rig.to_driver = [](Frame& frame) { return frame.id != 0x49; };
    expected = "knee1: no encoder estimate for 5";
    at_most = 60;
  }
  SECTION("no heartbeat") {
    rig.to_driver = [](Frame& frame) { return frame.id != 0x41; };
    expected = "knee1: no heartbeat for 5";
    at_most = 525;
  }
  SECTION("the drive's own watchdog, because our torques do not arrive") {
    rig.to_drive = [](Frame& frame) { return frame.id != 0x4E; };
    expected = "knee1: the drive went to IDLE: watchdog timer expired (disarmed)";
    at_most = 130;
  }
  SECTION("estimates that are no numbers") {
    rig.to_driver = [](Frame& frame) {
      if (frame.id == 0x49) frame.data[3] = 0x7F, frame.data[2] = 0xC0;
      return true;
    };
    expected = "knee1: no encoder estimate for 5";
    at_most = 60;
  }
  const int64_t took = rig.RunUntil(DriveState::kFault);
  CHECK(took >= 0);
  CHECK(took <= at_most);
  CHECK_THAT(rig.Reason(), StartsWith(expected));
  rig.Run(10);
  CHECK(rig.drives[0].Torque() == 0);  // the healthy one, too
  rig.Run(300);
  CHECK_FALSE(rig.drives[0].armed());
  rig.to_drive = nullptr;
  rig.Run(300);
  CHECK_FALSE(rig.drives[1].armed());
}

TEST_CASE("a drive that falls idle without an error is asked why") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.to_driver = [&](Frame& frame) {
    if (frame.id == 0x23) frame = *FrameFromText("023#0000000000000001");
    return true;
  };
  rig.Inject("021#0000000001000000");
  rig.Run(5);
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK_THAT(rig.Reason(), Equals("pivot: the drive went to IDLE: no error (success)"));
  rig.Run(20);
  CHECK_THAT(rig.Status().joint_reason[0], Equals("the drive disarmed itself: watchdog timer expired"));
}

TEST_CASE("commands that are none change nothing and feed nobody") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(20);
  rig.effort = std::numeric_limits<double>::quiet_NaN();
  rig.Run(100);
  CHECK(rig.drives[0].Torque() == 1);  // the last good one, until it expires
  CHECK(rig.Status().commands_rejected >= 19);
  rig.Run(20);
  CHECK(rig.drives[0].Torque() == 0);
  CHECK(rig.RunUntil(DriveState::kFault) >= 0);
  CHECK_THAT(rig.Reason(), StartsWith("no command for"));
}

TEST_CASE("stops on request") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(20);
  SECTION("DISARM") {
    rig.Request(driver_request_t::DISARM, 3'600'000'000);  // however old
    rig.Run(5);
    CHECK(rig.drives[0].Torque() == 0);
    CHECK(rig.driver->state() == DriveState::kIdle);
    CHECK(rig.Reason() == "disarmed on request");
    rig.Run(30);
    CHECK(rig.driver->confirmed_idle());
    CHECK(rig.drives[0].disarm_reason() == 0);
  }
  SECTION("ESTOP") {
    rig.Request(driver_request_t::ESTOP);
    rig.Run(5);
    CHECK(rig.drives[0].Torque() == 0);
    CHECK(rig.driver->state() == DriveState::kFault);
    CHECK(rig.Reason() == "emergency stop requested");
    CHECK(rig.drives[0].disarm_reason() == cansimple::kEstopRequested);
    rig.Run(1000);
    CHECK(rig.driver->state() == DriveState::kFault);
    CHECK(rig.Arm());  // ARM clears it
  }
}

TEST_CASE("a drive that does not obey gets its emergency stop") {
  Rig rig;
  rig.settings.watchdog = 0;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.to_drive = [](Frame& frame) { return frame.id != 0x27 && frame.id != 0x2E; };
  rig.Request(driver_request_t::DISARM);
  rig.Run(100);
  CHECK(rig.drives[0].armed());
  CHECK_FALSE(rig.driver->confirmed_idle());
  rig.Run(400);
  CHECK(rig.drives[0].disarm_reason() == cansimple::kEstopRequested);
  CHECK(rig.driver->confirmed_idle());
}

TEST_CASE("a drive that is found armed is disarmed") {
  Rig rig;
  rig.settings.watchdog = 0;
  rig.Start();
  for (const char* text : {"038#00", "02B#0100000001000000", "027#08000000", "02E#0000803F"}) {
    rig.drives[0].OnFrame(*FrameFromText(text), rig.now);
  }
  REQUIRE(rig.drives[0].Torque() == 1);
  rig.Run(30);
  CHECK_FALSE(rig.drives[0].armed());
}

TEST_CASE("the bus fails and comes back, the robot does not by itself") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(20);
  const char* expected = "";
  SECTION("link down") {
    rig.driver->OnLink(LinkState::kDown);
    expected = "the CAN interface is down";
  }
  SECTION("interface removed") {
    rig.driver->OnLink(LinkState::kGone);
    expected = "the CAN interface is gone";
  }
  SECTION("bus-off") {
    rig.Inject("20000040#0000000000000000");
    expected = "the CAN controller went bus-off";
  }
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK(rig.Reason() == expected);
  rig.Run(5);
  CHECK(rig.Sent() == std::vector<std::string>{"02E#0000000000000000", "027#0100000000000000"});
  rig.driver->OnLink(LinkState::kUp);
  rig.Inject("20000100#0000000000000000");
  rig.Run(500);
  CHECK(rig.Status().bus_up);
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK(rig.drives[0].Torque() == 0);
  CHECK(rig.Arm());
}

TEST_CASE("nobody acknowledges") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  for (int i = 0; i < 16; ++i) rig.Inject("20000020#0000000000000000");
  CHECK(rig.driver->state() == DriveState::kArmed);
  rig.Inject("20000020#0000000000000000");
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK_THAT(rig.Reason(), Contains("acknowledges"));
}

TEST_CASE("a bus that accepts nothing for ten cycles is a fault") {
  Rig rig;
  rig.settings.watchdog = 0;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(20);
  rig.bus_full = true;
  rig.Run(45);
  CHECK(rig.driver->state() == DriveState::kArmed);
  rig.bus_full = false;
  rig.Run(5);
  rig.bus_full = true;
  CHECK(rig.RunUntil(DriveState::kFault) == 50);
  CHECK_THAT(rig.Reason(), Equals("the bus has not accepted frames in 10 cycles"));
  // What was not accepted is not sent later: there is one disarm, not ten cycles of torques.
  rig.bus_full = false;
  rig.Run(60);
  CHECK_FALSE(rig.drives[0].armed());
}

TEST_CASE("frames that only look like ours are not") {
  Rig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(20);
  const size_t states = rig.states.size();
  const int64_t rejected = rig.Status().frames_rejected;
  for (const char* text : {"029#R8", "00000029#0000803F0000803F", "029##00000803F0000803F", "20000001#0000000001000000",
                           "021#R", "00000021#0000000001000000", "021##00000000001000000"}) {
    rig.Inject(text);
  }
  while (rig.driver->NextState()) FAIL("a state from frames that are not ours");
  CHECK(rig.driver->state() == DriveState::kArmed);
  CHECK(rig.Status().frames_rejected == rejected + 6);  // error frames are no frames
  for (const char* text : {"029#000080BE", "029#0000C07F00006040", "029#00008040000080FF", "021#000000000800", "03F#",
                           "029#"}) {
    rig.Inject(text);
  }
  while (rig.driver->NextState()) FAIL("a state from malformed frames");
  CHECK(rig.Status().frames_rejected == rejected + 12);
  rig.Run(100);
  CHECK(rig.driver->state() == DriveState::kArmed);
  CHECK(rig.states.size() == states + 20);
}

TEST_CASE("JOINT_STATE comes once per measurement, with regular times and the effort that acted") {
  Rig rig(2);
  rig.cycle_phase = 2000;
  rig.Start();
  int64_t step = 0;
  rig.on_step = [&] {
    ++step;
    rig.effort = std::sin(0.013 * static_cast<double>(step));
    for (size_t i = 0; i < 2; ++i) rig.samples[i] = {0.001 * static_cast<double>(step), 1.0 / kTwoPi};
  };
  REQUIRE(rig.Arm());
  // What was sent when, noted by the receiver's side.
  struct Setpoint {
    int64_t utime;
    double effort;
  };
  std::vector<Setpoint> setpoints;
  rig.to_drive = [&](Frame& frame) {
    const auto values = DecodePayload(cansimple::kSetInputTorque, frame);
    if (frame.id == 0x4E) setpoints.push_back({rig.utime(), (*values)[0]});
    return true;
  };
  rig.Run(50);
  rig.states.clear();
  rig.Run(1000);
  REQUIRE(rig.states.size() == 200);
  for (size_t i = 0; i < rig.states.size(); ++i) {
    const joint_state_t& state = rig.states[i];
    CHECK(state.num_joints == 2);
    CHECK(state.valid[1]);
    CHECK(state.velocity[1] == Approx(1));
    CHECK(std::isnan(state.effort_measured[0]));
    if (i == 0) continue;
    CHECK(state.sequence == rig.states[i - 1].sequence + 1);
    const int64_t from = rig.states[i - 1].utime, to = state.utime;
    CHECK(to - from == Approx(5000).margin(2));
    double integral = 0;
    for (size_t k = 0; k < setpoints.size(); ++k) {
      const int64_t begin = std::max(from, setpoints[k].utime);
      const int64_t end = std::min(to, k + 1 < setpoints.size() ? setpoints[k + 1].utime : to);
      if (end > begin) integral += setpoints[k].effort * static_cast<double>(end - begin);
    }
    CHECK(state.effort_applied[1] == Approx(integral / static_cast<double>(to - from)).margin(1e-6));
  }
}

TEST_CASE("the first JOINT_STATE has no effort applied, idle ones have zero") {
  Rig rig;
  rig.Start();
  rig.Run(50);
  REQUIRE(rig.states.size() == 10);
  CHECK(std::isnan(rig.states[0].effort_applied[0]));
  CHECK(rig.states.back().effort_applied[0] == 0);
  CHECK(rig.states.back().effort_sent[0] == 0);
}

TEST_CASE("an effort that the bus did not accept was not applied") {
  Rig rig;
  rig.settings.watchdog = 0;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(50);
  rig.bus_full = true;
  rig.effort = -1;
  rig.Run(20);
  CHECK(rig.states.back().effort_sent[0] == 1);
  CHECK(rig.states.back().effort_applied[0] == Approx(1));
  rig.bus_full = false;
  rig.Run(20);
  CHECK(rig.states.back().effort_applied[0] == Approx(-1));
}

TEST_CASE("torques that the drive reports reach the message at the joint's side") {
  Rig rig;
  rig.settings.torques_period = 5'000;
  rig.robot.joints[0].motor.gear = 2;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(50);
  CHECK(rig.states.back().effort_measured[0] == Approx(1));
}

TEST_CASE("the status message counts") {
  Rig rig;
  rig.Start();
  rig.stats = {.received = 0, .sent = 70, .refused = 3, .malformed = 4, .lost = 5, .echoes = 6};
  rig.lateness = 3;
  rig.Run(50);
  rig.lateness = 6000;
  rig.Run(5);
  const driver_status_t& status = rig.Status();
  CHECK(status.state == driver_status_t::IDLE);
  CHECK(status.joint_name == std::vector<std::string>{"pivot"});
  CHECK(status.frames_sent == 70);
  CHECK(status.frames_dropped == 8);
  CHECK(status.frames_rejected == 4);
  CHECK(status.frames_received == 11 + 2);  // estimates, heartbeats
  CHECK(status.cycles == 11);
  CHECK(status.overruns == 1);
  CHECK(status.num_bins == static_cast<int32_t>(status.lateness.size()));
  CHECK(status.lateness[1] == 10);
  CHECK(status.lateness[12] == 1);
  std::vector<uint8_t> buffer(static_cast<size_t>(status.getEncodedSize()));
  CHECK(status.encode(buffer.data(), 0, static_cast<int>(buffer.size())) == static_cast<int>(buffer.size()));
}

TEST_CASE("robots it cannot drive") {
  Rig rig(2);
  rig.robot.joints[1].motor.node = 1;
  CHECK_THROWS_WITH(rig.Start(), Contains("'pivot' and 'knee1'"));
  rig.robot.joints[1].motor = {.protocol = "telepathy", .node = 2};
  CHECK_THROWS_WITH(rig.Start(), Contains("telepathy") && Contains("cansimple"));
  rig.robot.joints[1].motor = {.protocol = "cansimple", .node = 63};
  CHECK_THROWS_WITH(rig.Start(), Contains("63"));
}

}  // namespace
}  // namespace plumb
