// Faults in a drive, or in the process that drives it.

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/drivers/driver/fault.h"

namespace plumb {
namespace {

using Catch::Matchers::Contains;

bool FromKnee(const Frame& frame) { return frame.id >> 5 == 2; }

TEST_CASE("fault 1: a drive falls silent", "[fault]") {
  ExpectStop({.number = "1",
              .name = "a drive falls silent",
              .detection = "no encoder estimate for `stale_after`",
              .happens = [](BusRig& rig) { rig.silent = FromKnee; },
              .is_over = [](BusRig& rig) { rig.silent = BusRig::Nothing; },
              .reason = "knee1: no encoder estimate for 5",
              .within = 60,
              // elsewhere than at its zero, where it would be taken to have lost its power
              .prepare =
                  [](BusRig& rig) {
                    rig.each_millisecond.push_back([&rig] { rig.samples[1].position = 0.3; });
                  }});
}

TEST_CASE("fault 2: a drive goes idle and reports no error", "[fault]") {
  ExpectStop(
      {.number = "2",
       .name = "a drive goes idle and reports no error",
       .detection = "the state in its heartbeat",
       .happens =
           [](BusRig& rig) { rig.drives[1].OnFrame(*FrameFromText("047#01000000"), rig.now); },
       .reason = "knee1: the drive went to IDLE: no error",
       .within = 25});
}

TEST_CASE("fault 3: a drive's watchdog expires", "[fault]") {
  ExpectStop(
      {.number = "3",
       .name = "torques do not reach a drive",
       .detection = "its watchdog; error and state in its heartbeat",
       .happens =
           [](BusRig& rig) { rig.deaf = [](const Frame& frame) { return frame.id == 0x4E; }; },
       .is_over = [](BusRig& rig) { rig.deaf = BusRig::Nothing; },
       .reason = "knee1: the drive went to IDLE: watchdog timer expired",
       .within = 130});
}

TEST_CASE("fault 4: the driver's process stands still", "[fault]") {
  ExpectStop({.number = "4",
              .name = "the driver's process stands still or dies",
              .detection = "the drives' watchdogs; when it goes on, their heartbeats",
              .happens =
                  [](BusRig& rig) {
                    const joint_command_t old = rig.MakeCommand(2);
                    rig.StopDriver(200);
                    rig.driver->OnCommand(old, rig.now, rig.utime());  // that had waited for it
                  },
              .reason = "pivot: the drive went to IDLE: watchdog timer expired",
              .within = 105});
}

TEST_CASE("fault 4: the driver's process stands still for a shorter time than the watchdog",
          "[fault]") {
  ExpectToRunOn({.number = "4",
                 .name = "it stands still for less than the watchdog and `stale_after`",
                 .detection = "DRIVER_STATUS.overruns",
                 .happens = [](BusRig& rig) { rig.StopDriver(40); },
                 .within = 50});
}

TEST_CASE(
    "an ARM that waited while the driver's process stood still is older than what stopped it") {
  BusRig rig;
  Bring(rig, 0);
  rig.driver_stopped = true;
  rig.Run(20);
  driver_request_t arm{};
  arm.utime = rig.utime();
  arm.request = driver_request_t::ARM;
  rig.Run(10);
  rig.driver_stopped = false;
  SECTION("the link") {
    rig.driver->OnLink(0, LinkState::kDown);
    rig.driver->OnLink(0, LinkState::kUp);
  }
  SECTION("the controller") {
    rig.ControllerSays("20000040#0000000000000000");
    rig.ControllerSays("20000100#0000000000000000");
  }
  REQUIRE(rig.driver->state() == DriveState::kFault);
  rig.driver->OnRequest(arm, rig.now, rig.utime());
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK_THAT(rig.Reason(), Contains("ARM refused: it was made before the driver stopped"));
  CHECK(rig.Arm());
}

TEST_CASE("fault 11: an idle drive with the same node id joins", "[fault]") {
  const auto heartbeat = [](BusRig& rig) {
    rig.each_millisecond.push_back([&rig] {
      if (rig.now % 20'000 == 7000) rig.StrangerSends("041#0000000001000000");
    });
  };
  ExpectStop({.number = "11",
              .name = "another drive, idle, has the same node id",
              .detection = "heartbeats that say something else",
              .happens = heartbeat,
              .is_over = [](BusRig& rig) { rig.each_millisecond.clear(); },
              .reason = "knee1: the drive went to IDLE: no error",
              .within = 30});
}

TEST_CASE("fault 11: a drive with the same node id joins, and says the same", "[fault]") {
  const auto estimates = [](BusRig& rig) {
    rig.each_millisecond.push_back([&rig] {
      if (rig.now % 5'000 == 2000) rig.StrangerSends("049#0000000000000000");
    });
  };
  ExpectStop({.number = "11",
              .name = "another drive has the same node id and says the same",
              .detection =
                  "more than 150 encoder estimates in 100 periods; ARM is refused while they come",
              .happens = estimates,
              .is_over = [](BusRig& rig) { rig.each_millisecond.clear(); },
              .reason = "knee1: 151 encoder estimates in 3",
              .within = 650});
}

TEST_CASE("fault 12: a drive restarts", "[fault]") {
  ExpectStop({.number = "12",
              .name = "a drive loses its power and restarts elsewhere",
              .detection = "no encoder estimate for `stale_after`; then silence, IDLE and a jump: "
                           "\"home the joint anew\"",
              .happens =
                  [](BusRig& rig) {
                    rig.drives[1].Reboot(rig.now);
                    rig.silent = FromKnee;
                    rig.Run(300);
                    rig.silent = BusRig::Nothing;
                    rig.samples[1].position += 0.4;
                  },
              .is_over =
                  [](BusRig& rig) {
                    CHECK_THAT(rig.Status().joint_reason[1],
                               Contains("restarted") && Contains("home the joint anew"));
                    CHECK_FALSE(rig.Arm(1));
                    CHECK_THAT(rig.Reason(),
                               Contains("ARM refused") &&
                                   Contains("home the joint, then plumb arm --homed"));
                    rig.commanding = false;
                  },
              .reason = "knee1: no encoder estimate for 5",
              .arm = driver_request_t::ARM_HOMED,
              .within = 60});
}

TEST_CASE("a request that homes is obeyed for all joints, or for none") {
  BusRig rig;
  rig.Start();
  REQUIRE(rig.Arm(1));
  for (CanSimpleDevice& drive : rig.drives) drive.Reboot(rig.now);
  rig.silent = [](const Frame& frame) { return FromKnee(frame) || frame.id >> 5 == 1; };
  rig.Run(300);
  rig.silent = BusRig::Nothing;
  for (auto& sample : rig.samples) sample.position += 0.4;
  rig.commanding = false;
  rig.Run(300);
  // Refused for the second joint, which is not heard: the first one is not homed either.
  rig.silent = FromKnee;
  rig.Run(100);
  rig.Request(driver_request_t::ARM_HOMED);
  rig.Run(10);
  CHECK_THAT(rig.Reason(), Contains("ARM refused: knee1"));
  rig.silent = BusRig::Nothing;
  rig.Run(600);
  rig.Request(driver_request_t::ARM);
  rig.Run(10);
  CHECK_THAT(rig.Reason(), Contains("pivot: its drive has lost its place"));
  rig.Request(driver_request_t::ARM_HOMED);
  CHECK(rig.RunUntil(DriveState::kArmed) >= 0);
}

TEST_CASE("fault 13: heartbeats stay away, encoder estimates do not", "[fault]") {
  ExpectStop(
      {.number = "13",
       .name = "a drive's heartbeats stay away, its encoder estimates do not",
       .detection = "no heartbeat for `heartbeat_timeout`",
       .happens =
           [](BusRig& rig) { rig.silent = [](const Frame& frame) { return frame.id == 0x41; }; },
       .is_over = [](BusRig& rig) { rig.silent = BusRig::Nothing; },
       .reason = "knee1: no heartbeat for 50",
       .within = 510});
}

TEST_CASE("fault 13: an encoder jumps", "[fault]") {
  ExpectStop({.number = "13",
              .name = "an encoder jumps by half a radian",
              .detection = "farther than the velocity limit lets the joint go",
              .happens = [](BusRig& rig) { rig.samples[1].position += 0.5 / (2 * std::acos(-1.)); },
              .is_over =
                  [](BusRig& rig) {
                    CHECK_FALSE(rig.Arm(1));
                    CHECK_THAT(rig.Reason(),
                               Contains("ARM refused: knee1: its position has jumped: home the "
                                        "joint, then plumb arm --homed"));
                    rig.commanding = false;
                  },
              .reason = "knee1: the position jumped by 0.5 in 5 ms",
              .arm = driver_request_t::ARM_HOMED,
              .within = 5});
}

TEST_CASE("fault 13: an encoder is stuck", "[fault]") {
  const auto tremble = [](BusRig& rig) {  // as healthy ones do
    rig.each_millisecond.push_back([&rig] {
      for (auto& sample : rig.samples)
        sample.velocity = 1e-4 * static_cast<double>(rig.now / 1000 % 7);
    });
  };
  ExpectStop(
      {.number = "13",
       .name = "an encoder is stuck, or the joint blocked",
       .detection = "the same bits under an effort for `stuck_after` (off unless set), here 200 ms",
       .happens = [](BusRig& rig) { rig.each_millisecond.clear(); },
       .is_over = tremble,
       .reason = "pivot: encoder stuck, or the joint is blocked",
       .within = 205,
       .prepare =
           [&](BusRig& rig) {
             rig.robot.driver.stuck_after = 0.2;
             tremble(rig);
           }});
}

TEST_CASE("fault 13: position and velocity contradict each other", "[fault]") {
  ExpectStop(
      {.number = "13",
       .name = "a position stands still while its velocity says 1 rad/s",
       .detection =
           "position and integral of the velocity differ by more than lags and losses explain",
       .happens = [](BusRig& rig) { rig.samples[1].velocity = 1 / (2 * std::acos(-1.)); },
       .is_over = [](BusRig& rig) { rig.samples[1].velocity = 0; },
       .reason = "knee1: position and velocity disagree: it moved by 0 in",
       .within = 500});
}

}  // namespace
}  // namespace plumb
