// Who else may interfere: commands that stay away, other masters, clocks, recordings.

#include <catch2/catch.hpp>
#include <fstream>

#include "tests/drivers/driver/fault.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

using Catch::Matchers::Contains;

TEST_CASE("fault 0: commands stay away", "[fault]") {
  ExpectStop({.number = "0",
              .name = "commands stay away: controller, estimator or their connection stopped",
              .detection =
                  "the last one is older than `expiry`: zero torque; than `disarm_after`: disarmed",
              .happens = [](BusRig& rig) { rig.commanding = false; },
              .reason = "no command for 25",
              .within = 105});
}

TEST_CASE("fault 14: another master", "[fault]") {
  ExpectStop({.number = "14",
              .name = "somebody else sends a torque",
              .detection = "a frame that only the driver may send, and that it has not sent",
              .happens = [](BusRig& rig) { rig.StrangerSends("02E#0000A03F"); },
              .reason = "second master: somebody else sends frame 0x02e to the drives",
              .within = 6});
}

TEST_CASE("fault 15: an Estop from somebody else", "[fault]") {
  ExpectStop({.number = "15",
              .name = "somebody else sends a drive an Estop",
              .detection = "an Estop that is not ours; that drive obeys at once",
              .happens = [](BusRig& rig) { rig.StrangerSends("042#"); },
              .reason = "emergency stop from the bus",
              .within = 6});
}

TEST_CASE("fault 15: a broadcast Estop", "[fault]") {
  ExpectStop({.number = "15",
              .name = "somebody else sends all drives an Estop (broadcast)",
              .detection = "an Estop that is not ours; they obey at once",
              .happens = [](BusRig& rig) { rig.StrangerSends("7E2#"); },
              .reason = "emergency stop from the bus",
              .within = 6});
}

TEST_CASE("fault 16: the real-time clock is set", "[fault]") {
  struct Case {
    int64_t back;
    const char* name;
  };
  const auto [by, name] =
      GENERATE(values<Case>({{3'600'000'000, "the clock is set back by an hour"},
                             {30'000, "the clock is set back by 30 ms"},
                             {-3'600'000'000, "the clock is set forward by an hour"}}));
  const int64_t back = by;
  ExpectToRunOn({.number = "16",
                 .name = name,
                 .detection = "-",
                 .happens = [back](BusRig& rig) { rig.states.clear(), rig.set_back = back; },
                 .is_over =
                     [back](BusRig& rig) {
                       int backwards = 0;
                       for (size_t i = 1; i < rig.states.size(); ++i)
                         backwards += rig.states[i].utime <= rig.states[i - 1].utime;
                       CHECK(backwards <= (back > 0 ? 1 : 0));
                       CHECK(rig.states.size() >= 90);
                     },
                 .within = 10});
}

TEST_CASE("fault 16: the controller's clock is another", "[fault]") {
  const int64_t ahead = GENERATE(-1'000'000, 1'000'000);
  ExpectStop(
      {.number = "16",
       .name = ahead < 0 ? "the controller's clock is behind the driver's"
                         : "the controller's clock is ahead of the driver's",
       .detection = "its commands look older than `expiry`, or from the future: they are refused",
       .happens =
           [ahead](BusRig& rig) {
             rig.commanding = false;
             rig.each_millisecond.push_back([&rig, ahead] {
               joint_command_t command = rig.MakeCommand(1);
               command.utime += ahead;
               rig.driver->OnCommand(command, rig.now, rig.utime());
             });
           },
       .is_over = [](BusRig& rig) { rig.each_millisecond.clear(); },
       .reason = ahead < 0 ? "commands refused: they were computed too long ago"
                           : "commands refused: they are dated in the future",
       .within = 105});
}

TEST_CASE("fault 17: a log is played on the live bus", "[fault]") {
  ExpectStop(
      {.number = "17",
       .name = "a log is played on the live bus",
       .detection = "as 14; ARM is refused while it lasts",
       .happens =
           [](BusRig& rig) {
             rig.each_millisecond.push_back([&rig] {
               for (const char* text :
                    {"029#0000803E00000000", "02E#0000803F", "021#0000000008000000"})
                 rig.StrangerSends(text);
             });
           },
       .is_over =
           [](BusRig& rig) {
             rig.Request(driver_request_t::ARM);
             CHECK_THAT(rig.Reason(), Contains("second master"));
             rig.each_millisecond.clear();
           },
       .reason = "second master: somebody else sends frame 0x02e to the drives",
       .arm = driver_request_t::ARM_HOMED,  // what the log said of positions looks like a restart
       .within = 25});
}

TEST_CASE("fault 17: a recording instead of a bus", "[fault]") {
  const TemporaryFolder folder;
  const std::string log = folder / "recording.log";
  {
    std::ofstream file(log);
    for (int i = 0; i < 400; ++i) {
      file << fmt::format("({}.{:06}) can0 029#0000803E00000000\n", i / 200, i % 200 * 5000);
      if (i % 4 == 0)
        file << fmt::format("({}.{:06}) can0 021#0000000008000000\n", i / 200,
                            i % 200 * 5000 + 100);
    }
  }
  Rig rig;
  rig.Start();
  const auto recording = OpenTransport("replay:" + log, rig.driver->filters(0));
  rig.driver->set_replay(recording->is_replay());
  rig.to_driver = [](Frame&) { return false; };
  rig.on_step = [&] {
    recording->SetTime(rig.now);
    std::array<Frame, 8> frames;
    const int count = recording->Receive(frames);
    for (int i = 0; i < count; ++i)
      rig.driver->OnFrame(0, frames[static_cast<size_t>(i)], rig.now, rig.utime());
  };
  CHECK_FALSE(rig.Arm(1));
  CHECK(rig.states.size() > 50);  // it plays
  CHECK_THAT(rig.Reason(), Contains("ARM refused: the bus is a recording"));
  const Fault row{.number = "17",
                  .name = "a recording instead of a bus",
                  .detection = "`replay:`",
                  .happens = {}};
  row.PrintRow("refuses to arm: the bus is a recording", "0 ms");
}

}  // namespace
}  // namespace plumb
