#include "drivers/protocols/cansimple_device.h"

#include <catch2/catch.hpp>
#include <string>
#include <vector>

namespace plumb {
namespace {

using Texts = std::vector<std::string>;

/// A drive of node 1 that is talked to in candump's language.
struct Bench {
  explicit Bench(CanSimpleDevice::Settings settings = Defaults()) : drive(settings, 1'000'000) {}

  static CanSimpleDevice::Settings Defaults() {
    CanSimpleDevice::Settings settings;
    settings.heartbeat_period = 20'000;
    settings.encoder_period = 5'000;
    settings.watchdog = 50'000;
    settings.serial_number = 0x335E3D563432;
    return settings;
  }

  Texts Tick(int64_t to) {
    now = to;
    FrameBatch batch;
    drive.Tick(now, sample, batch);
    Texts texts;
    for (const Frame& frame : batch.frames()) texts.push_back(ToText(frame));
    return texts;
  }
  /// Sends frames at the present time and returns the answers.
  Texts Send(std::initializer_list<const char*> texts) {
    for (const char* text : texts) drive.OnFrame(*FrameFromText(text), now);
    return Tick(now);
  }
  void Arm() {
    Send({"038#00", "02B#0100000001000000", "02E#0000000000000000", "027#0800000000000000"});
  }

  CanSimpleDevice drive;
  int64_t now = 1'000'000;
  CanSimpleDevice::Sample sample{-0.25, 3.5};
};

TEST_CASE("the virtual drive reports on an absolute schedule") {
  Bench bench;
  CHECK(bench.drive.NextDue() == 1'005'000);
  CHECK(bench.Tick(1'004'999).empty());
  CHECK(bench.Tick(1'005'000) == Texts{"029#000080BE00006040"});
  CHECK(bench.Tick(1'005'001).empty());
  // Late by two and a half periods: one report, and back on the grid.
  CHECK(bench.Tick(1'017'500) == Texts{"029#000080BE00006040"});
  CHECK(bench.drive.NextDue() == 1'020'000);
  CHECK(bench.Tick(1'020'000) == Texts{"029#000080BE00006040", "021#0000000001000000"});
}

TEST_CASE("the virtual drive answers requests, remote or empty") {
  Bench bench;
  CHECK(bench.Send({"029#R"}) == Texts{"029#000080BE00006040"});
  CHECK(bench.Send({"029#"}) == Texts{"029#000080BE00006040"});
  CHECK(bench.Send({"020#R"}) == Texts{"020#0204043A00060A00"});
  CHECK(bench.Send({"023#R"}) == Texts{"023#0000000000000000"});
  CHECK(bench.Send({"034#R"}) == Texts{"034#0000000000000000"});
  CHECK(bench.Send({"035#R"}) == Texts{"035#0000C8410000C841"});
  CHECK(bench.Send({"037#R"}) == Texts{"037#0000C04100000000"});
  CHECK(bench.Send({"03C#R"}) == Texts{"03C#0000000000000000"});
  CHECK(bench.Send({"7E6#R"}) == Texts{"7E6#013234563D5E33"});
  CHECK(bench.Send({"029#R", "020#R", "029#R8"}) ==
        Texts{"029#000080BE00006040", "020#0204043A00060A00"});
  CHECK(bench.Send({"049#R", "00000029#", "20000029#0000000000000000"})
            .empty());  // other node, extended, error
  CHECK(bench.drive.rejected() == 0);
}

TEST_CASE("torque needs the closed loop, torque mode and a new setpoint") {
  Bench bench;
  bench.Send({"02E#0000C03F00000000"});
  CHECK(bench.drive.Torque() == 0);
  bench.Send({"02B#0100000001000000", "027#0800000000000000"});
  CHECK(bench.drive.armed());
  CHECK(bench.drive.Torque() == 0);  // the setpoint from before arming is forgotten
  bench.Send({"02E#0000C03F00000000"});
  CHECK(bench.drive.Torque() == 1.5);
  CHECK(bench.Send({"03C#R"}) == Texts{"03C#0000C03F0000C03F"});
  bench.Send({"02B#0300000001000000"});  // position control
  CHECK(bench.drive.Torque() == 0);
  bench.Send({"02B#0100000006000000"});  // torque ramp
  CHECK(bench.drive.Torque() == 0);
  bench.Send({"02B#0100000001000000"});
  CHECK(bench.drive.Torque() == 1.5);
  bench.Send({"027#01000000"});
  CHECK_FALSE(bench.drive.armed());
  CHECK(bench.drive.Torque() == 0);
}

TEST_CASE("setpoints may be short but not nonsense") {
  Bench bench;
  bench.Arm();
  bench.Send({"02E#0000C03F"});
  CHECK(bench.drive.Torque() == 1.5);
  bench.Send({"02E#0000C0", "02E#0000C07F", "02E#0000807F00000000", "02E#R", "01F#00", "03E#00"});
  CHECK(bench.drive.Torque() == 1.5);
  CHECK(bench.drive.rejected() == 5);  // 01F is node 0's
}

TEST_CASE("the watchdog is fed by setpoints only and disarms on time") {
  Bench bench;
  bench.Arm();
  CHECK(bench.drive.NextDue() == 1'005'000);
  bench.Tick(1'040'000);
  bench.Send({"02E#0000C03F"});
  bench.Tick(1'080'000);
  bench.Send({"029#R", "02B#0100000001000000"});  // no food
  bench.Tick(1'085'000);
  bench.Tick(1'089'999);
  CHECK(bench.drive.Torque() == 1.5);
  CHECK(bench.drive.NextDue() == 1'090'000);
  bench.Tick(1'090'000);
  CHECK_FALSE(bench.drive.armed());
  CHECK(bench.drive.Torque() == 0);
  CHECK(bench.Send({"021#R", "023#R"}) == Texts{"021#0000000101030000", "023#0000000100000001"});

  SECTION("a setpoint takes the error away but not the disarm reason") {
    bench.Send({"02E#0000C03F"});
    CHECK(bench.Send({"023#R"}) == Texts{"023#0000000000000001"});
    CHECK(bench.Send({"027#0800000000000000", "021#R"}) == Texts{"021#0000000101030000"});
    CHECK(bench.drive.Torque() == 0);
  }
  SECTION("clearing errors and a fed watchdog lead back") {
    bench.Arm();
    CHECK(bench.drive.armed());
    CHECK(bench.Send({"021#R"}) == Texts{"021#0000000008000000"});
  }
  SECTION("clearing errors without food does not") {
    bench.Send({"038#00", "027#0800000000000000"});
    CHECK_FALSE(bench.drive.armed());
    CHECK(bench.drive.disarm_reason() == cansimple::kWatchdogTimerExpired);
  }
}

TEST_CASE("a setpoint that comes after the watchdog's time is too late") {
  Bench bench;
  bench.Arm();
  bench.now = 1'051'000;
  bench.Send({"02E#0000C03F"});
  CHECK_FALSE(bench.drive.armed());
  CHECK(bench.drive.Torque() == 0);
}

TEST_CASE("emergency stop, addressed or to all") {
  const char* text = GENERATE("022#", "7E2#");
  Bench bench;
  bench.Arm();
  bench.Send({"02E#0000C03F", text});
  CHECK(bench.drive.Torque() == 0);
  CHECK(bench.Send({"021#R"}) == Texts{"021#0000000201030000"});
  bench.Send({"027#0800000000000000"});
  CHECK_FALSE(bench.drive.armed());
  bench.Arm();
  CHECK(bench.drive.armed());
}

TEST_CASE("a state it does not have is refused with a procedure result") {
  Bench bench;
  CHECK(bench.Send({"027#03000000", "021#R"}) == Texts{"021#00000000010D0000"});
}

TEST_CASE("without watchdog the last setpoint holds") {
  auto settings = Bench::Defaults();
  settings.watchdog = 0;
  Bench bench(settings);
  bench.Arm();
  bench.Send({"02E#0000C03F"});
  bench.Tick(60'000'000);
  CHECK(bench.drive.Torque() == 1.5);
}

TEST_CASE("settings a drive cannot have") {
  auto settings = Bench::Defaults();
  settings.node = 63;
  CHECK_THROWS_AS(CanSimpleDevice(settings, 0), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
