#include "drivers/driver/plausibility.h"

#include <catch2/catch.hpp>

#include "common/special_numbers.h"
#include "tests/drivers/driver/plausibility_rig.h"

namespace plumb {
namespace {

using Catch::Matchers::Contains;
using Catch::Matchers::Equals;
using Catch::Matchers::StartsWith;
using Sample = CanSimpleDevice::Sample;

constexpr const char* kBadBus = "faulty:loss=0.3,jitter=10ms,duplicate=0.05:";

TEST_CASE("a healthy joint on any bus gives no cause for complaint") {
  for (const auto& robot : {PlausibilityRig::kPendulum, PlausibilityRig::kHopper}) {
    for (const char* faults :
         {"", kBadBus, "faulty:duplicate=0.2,reorder=0.1:", "faulty:delay=30ms,jitter=5ms:"}) {
      INFO(faults << " at " << robot.period << " us");
      PlausibilityRig rig(robot, faults);
      rig.Run(250);
      CHECK(rig.watch.complaint() == "");
      CHECK(rig.estimates > 250'000'000 / robot.period * 6 / 10);
      CHECK(rig.now == 255'000'000);
    }
  }
}

/// A fault of the encoder of a joint in motion, and after how many estimates it must be found.
struct EncoderFault {
  const char* name;
  std::function<void(Sample&)> change;
  const char* complaint;
  int64_t within;
};

TEST_CASE("what an encoder does wrong is found") {
  const auto freeze = [frozen = Sample{kNaN, 0}](Sample& sample) mutable {
    if (std::isnan(frozen.position)) frozen = sample;
    sample = frozen;
  };
  // On the bad bus the first estimates with the fault may be lost, or wait behind others. What a
  // velocity that is none explains last may be a jump or a disagreement.
  const auto fault = GENERATE_COPY(
      EncoderFault{"jump", [](Sample& s) { s.position += 6 / PlausibilityRig::kTurn; },
                   "the position jumped", 10},
      EncoderFault{"velocity reversed", [](Sample& s) { s.velocity *= -1; }, "", 300},
      EncoderFault{"velocity dead", [](Sample& s) { s.velocity = 0; }, "", 150},
      EncoderFault{"stuck", freeze, "", 60});
  for (const auto& robot : {PlausibilityRig::kPendulum, PlausibilityRig::kHopper}) {
    for (const char* bus : {"", kBadBus}) {
      for (uint32_t seed = 1; seed <= 10; ++seed) {
        PlausibilityRig rig(robot, bus, 100'000, seed);
        rig.Run(1 + 0.0137 * seed);
        REQUIRE(rig.watch.complaint() == "");
        rig.change = fault.change;
        const int64_t found = rig.Found(10);
        INFO(fault.name << " on '" << bus << "', " << robot.period << " us, seed " << seed << ": "
                        << found << ", " << rig.watch.complaint());
        CHECK(found > 0);
        CHECK(found <= fault.within);
        CHECK_THAT(std::string(rig.watch.complaint()), StartsWith(fault.complaint));
      }
    }
  }
}

TEST_CASE("at rest small jumps are found, and a second device") {
  for (const char* bus : {"", kBadBus}) {
    INFO(bus);
    PlausibilityRig rig(PlausibilityRig::kPendulum, bus);
    rig.effort = 0;
    rig.still = true;
    rig.Run(2);
    REQUIRE(rig.watch.complaint() == "");
    SECTION("jump") {
      rig.change = [](Sample& sample) { sample.position += 0.1 / PlausibilityRig::kTurn; };
      CHECK(rig.Found(0.1) > 0);
      CHECK_THAT(std::string(rig.watch.complaint()),
                 StartsWith("position and velocity disagree: it moved by 0.1 in"));
    }
    SECTION("second device that says the same") {
      rig.second = std::make_unique<CanSimpleDevice>(
          CanSimpleDevice::Settings{
              .node = 1, .heartbeat_period = 100'000, .encoder_period = 5'000},
          rig.now);
      CHECK(rig.Found(5) > 0);
      CHECK_THAT(std::string(rig.watch.complaint()),
                 StartsWith("151 encoder estimates in ") && Contains("two devices with one id"));
    }
  }
}

constexpr PlausibilitySettings kSettings{.velocity_limit = 20,
                                         .effort_limit = 2,
                                         .resolution = 0.01,
                                         .period = 5'000,
                                         .lateness = 50'000,
                                         .stuck_after = 0};

/// Estimates given by hand.
struct Given {
  explicit Given(const PlausibilitySettings& settings) : watch(settings) {}
  std::string Add(double position, double velocity, double effort = 0, int64_t dt = 5'000) {
    watch.Add(time += dt, position, velocity, effort);
    return std::string(watch.complaint());
  }
  Plausibility watch;
  int64_t time = 1'700'000'000'000'000;
};

TEST_CASE("a jump is what the velocity limit does not allow") {
  Given joint(kSettings);
  joint.Add(1, 0);
  SECTION("as far as it can come in the time and another period") {
    CHECK(joint.Add(1 + 20 * 0.010 + 0.0099, 100) == "");
  }
  SECTION("farther") {
    CHECK_THAT(
        joint.Add(1 + 20 * 0.010 + 0.0102, 100),
        Equals("the position jumped by 0.21 in 5 ms, at a velocity limit of 20 it can do 0.21"));
  }
  SECTION("in the time of ten losses") { CHECK(joint.Add(1 - 20 * 0.055, -200, 0, 50'000) == ""); }
  SECTION("late ones arrive together") {
    joint.Add(1.02, 4, 0, 5'000);
    CHECK(joint.Add(1.02 + 20 * 0.005 + 4 * 0.05, 4, 0, 0) == "");
    // and not back
    CHECK_THAT(joint.Add(1.02, 4, 0, 0), StartsWith("the position jumped by -0.3 in 0 ms"));
  }
  SECTION("no velocity") {
    joint.Add(1, kNaN);
    CHECK(joint.Add(1 + 20 * 0.060, kNaN) == "");
    CHECK_THAT(joint.Add(1 + 20 * 0.121, kNaN), StartsWith("the position jumped"));
  }
}

TEST_CASE("no velocity limit, no jump") {
  PlausibilitySettings settings = kSettings;
  settings.velocity_limit = kInfinity;
  Given joint(settings);
  joint.Add(0, kNaN);
  CHECK(joint.Add(1e6, kNaN) == "");
}

TEST_CASE("a complaint stays until it is taken back, and the first one counts") {
  Given joint(kSettings);
  joint.Add(0, 0);
  const std::string first = joint.Add(1, 0);
  CHECK(first != "");
  CHECK(joint.Add(1, 0) == first);
  CHECK(joint.Add(5, 0) == first);
  joint.watch.ClearComplaint();
  CHECK(joint.Add(5, 0) == "");
}

TEST_CASE("a clock that is set back, and silence, begin anew") {
  Given joint(kSettings);
  for (int i = 0; i < 50; ++i) joint.Add(0, 0);
  double position = 3;
  SECTION("clock set back") { CHECK(joint.Add(position, 0, 0, -3'600'000'000) == ""); }
  SECTION("silence") { CHECK(joint.Add(position, 0, 0, 1'000'000) == ""); }
  SECTION("clock set forward, and back again") {
    position = 0;
    CHECK(joint.Add(position, 0, 0, 3'600'000'000) == "");
    CHECK(joint.Add(position, 0, 0, -3'600'000'000) == "");
  }
  for (int i = 0; i < 500; ++i) REQUIRE(joint.Add(position, 0) == "");
}

TEST_CASE("the same bits under an effort are a stuck encoder") {
  PlausibilitySettings settings = kSettings;
  settings.stuck_after = 100'000;
  const auto after = [&](double effort, auto position, auto velocity) {
    Given joint(settings);
    for (int i = 0; i < 1000; ++i) {
      if (const std::string why = joint.Add(position(i), velocity(i), effort); !why.empty()) {
        CHECK_THAT(why, StartsWith("encoder stuck, or the joint is blocked: 0.5 at speed ") &&
                            Contains(" for 100 ms under an effort of "));
        return i;
      }
    }
    return -1;
  };
  const auto half = [](int) { return 0.5; };
  const auto zero = [](int) { return 0.0; };
  CHECK(after(0.2, half, zero) == 20);
  CHECK(after(-2, half, [](int) { return kNaN; }) == 20);
  CHECK(after(0.19, half, zero) == -1);
  CHECK(after(
            2, [](int i) { return i % 20 == 0 ? std::nextafter(0.5, 1) : 0.5; }, zero) == -1);
  CHECK(after(2, half, [](int i) { return i % 20 == 0 ? 1e-300 : 0.0; }) == -1);
  settings.stuck_after = 0;
  CHECK(after(2, half, zero) == -1);
}

TEST_CASE("a joint that is put elsewhere") {
  Given joint(kSettings);
  for (int i = 0; i < 50; ++i) joint.Add(0, 0);
  joint.watch.Displaced();
  CHECK(joint.Add(3, 1) == "");
  for (int i = 0; i < 300; ++i) REQUIRE(joint.Add(3, 0) == "");
  CHECK(joint.Add(0, 0) != "");
}

TEST_CASE("a second device is remembered until it is gone") {
  Given joint(kSettings);
  for (int i = 0; i < 1000; ++i) joint.Add(0, 0, 0, 2'500);
  CHECK(joint.watch.crowded());
  joint.watch.ClearComplaint();
  for (int i = 0; i < 100; ++i) joint.Add(0, 0);
  CHECK(joint.watch.complaint().empty());
  CHECK(joint.watch.crowded());
  for (int i = 0; i < 100; ++i) joint.Add(0, 0);
  CHECK_FALSE(joint.watch.crowded());
}

}  // namespace
}  // namespace plumb
