// Somebody else who sends what only the driver may send, and a bus that is none.

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>

#include "tests/drivers/driver/rig.h"

namespace plumb {
namespace {

using Catch::Matchers::Contains;

// As the transport marks it that was given the driver's filters.
Frame FromAnother(const Driver& driver, const char* text) {
  Frame frame = FrameFromText(text).value();
  frame.foreign = std::ranges::any_of(driver.filters(0), [&](const Filter& filter) {
    return filter.own && !filter.extended && (frame.id & filter.mask) == (filter.id & filter.mask);
  });
  return frame;
}

TEST_CASE("a second master of moteus drives is heard, whatever number it has") {
  const char* source = std::getenv("PLUMBLINE_SOURCE");
  const Driver driver(
      LoadRobot(std::string(source ? source : ".") + "/robots/pendulum/moteus.toml"), 0,
      Rig::kEpoch);
  const std::vector<Filter> filters = driver.filters(0);
  const auto own = [&](uint32_t id) {
    return std::ranges::any_of(filters, [&](const Filter& filter) {
      return filter.own && filter.extended && (id & filter.mask) == (filter.id & filter.mask);
    });
  };
  for (const uint32_t id : {0x8001, 0x8101, 0xFF01, 0x0101, 0x807F, 0x817F}) CHECK(own(id));
  CHECK_FALSE(own(0x0100));  // the drive's answer
  CHECK_FALSE(own(0x8102));  // to a drive that is not ours
}

TEST_CASE(
    "a second master on the bus stops the robot within the cycle, and keeps it from being armed") {
  Rig rig(2);
  rig.Start();
  const auto obeyed =
      GENERATE("02E#0000C03F", "04E#0000C03F00000000", "027#08000000", "02C#0000003F24FAFA00",
               "02D#000000C00000003E", "024#0101010000000000", "02F#000000400000A040", "036#00",
               "039#00000000", "03B#00000000");
  SECTION("armed") {
    REQUIRE(rig.Arm(1));
    rig.Run(50);
    rig.driver->OnFrame(0, FromAnother(*rig.driver, obeyed), rig.now, rig.utime());
    CHECK(rig.driver->state() == DriveState::kFault);
    CHECK_THAT(rig.Reason(), Contains("second master") &&
                                 Contains(fmt::format("{:#05x}", FrameFromText(obeyed)->id)));
    rig.Run(300);
    CHECK_FALSE(rig.drives[0].armed());
    CHECK(rig.driver->confirmed_idle());
    CHECK(rig.Arm(1));  // it has gone: a person may arm again
  }
  SECTION("before") {
    rig.Run(300);
    rig.driver->OnFrame(0, FromAnother(*rig.driver, obeyed), rig.now, rig.utime());
    rig.Request(driver_request_t::ARM);
    CHECK(rig.driver->state() != DriveState::kArming);
    CHECK_THAT(rig.Reason(), Contains("second master"));
    rig.Run(300);
    rig.Request(driver_request_t::ARM);
    CHECK(rig.driver->state() == DriveState::kArming);
  }
}

TEST_CASE("an emergency stop that somebody sends on the bus is everybody's, and a person's") {
  Rig rig(2);
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(50);
  const auto frame = GENERATE("022#", "042#", "7E2#");  // to one drive, to the other, to all
  rig.driver->OnFrame(0, FromAnother(*rig.driver, frame), rig.now, rig.utime());
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK(rig.Reason() == "emergency stop from the bus");
  CHECK(rig.Status().stopped_by_request);
  rig.Run(50);
  for (const CanSimpleDevice& drive : rig.drives) {
    CHECK_FALSE(drive.armed());
    CHECK(drive.disarm_reason() == cansimple::kEstopRequested);
  }
  rig.Run(1000);
  CHECK(rig.driver->state() == DriveState::kFault);
  CHECK(rig.Arm(1));
}

TEST_CASE("the transport is asked to tell another's commands from ours, for every drive") {
  Rig rig(2);
  rig.Start();
  const auto driver_end = OpenTransport("loop:second_master", rig.driver->filters(0)),
             other = OpenTransport("loop:second_master");
  const Frame sent[] = {FrameFromText("02E#0000C03F").value(),
                        FrameFromText("047#0800000000000000").value(),
                        FrameFromText("029#000080BE00006040").value()};
  REQUIRE(other->Send(sent) == 3);
  std::array<Frame, 8> received;
  REQUIRE(driver_end->Receive(received) == 3);
  CHECK(received[0].foreign);
  CHECK(received[1].foreign);
  CHECK_FALSE(received[2].foreign);  // a drive's
  CHECK(driver_end->stats().foreign == 2);
}

TEST_CASE("a second master of RMD motors is heard in the motion mode, too") {
  const char* source = std::getenv("PLUMBLINE_SOURCE");
  const Driver driver(LoadRobot(std::string(source ? source : ".") + "/robots/pendulum/rmd.toml"),
                      0, Rig::kEpoch);
  CHECK(FromAnother(driver, "141#A100000064000000").foreign);
  CHECK(FromAnother(driver, "401#7FFF7FF000000FFF").foreign);
  CHECK_FALSE(FromAnother(driver, "241#A100000064000000").foreign);
}

TEST_CASE("a recording is no robot") {
  Rig rig;
  rig.Start();
  rig.driver->set_replay(true);
  CHECK_FALSE(rig.Arm());
  CHECK_THAT(rig.Reason(), Contains("recording"));
}

TEST_CASE("a bus that cannot work is refused with the names and the numbers") {
  Rig rig(2);
  SECTION("two drives of one node") {
    rig.robot.joints[1].motor.node = 1;
    CHECK_THROWS_WITH(rig.Start(),
                      Contains("pivot") && Contains("knee1") && Contains("CAN id 0x02"));
  }
  SECTION("more than it carries") {
    rig.robot.driver.cycle = rig.robot.driver.measurement = 0.0003;
    CHECK_THROWS_WITH(rig.Start(), Contains("%"));
  }
}

}  // namespace
}  // namespace plumb
