// Buses of CAN FD.

#include <catch2/catch.hpp>

#include "tests/drivers/bus/bus_devices.h"

namespace plumb {
namespace {

using Catch::Contains;

TEST_CASE("moteus on a bus of CAN FD: a command and an answer in every cycle") {
  // 49 + 421 / 5 us and 30 + 293 / 5; at worst 57 + 519 / 5 and 34 + 358 / 5.
  const double command = 160.8, answer = 105.6;
  const BusPlan plan = PlanBus(Motors({Moteus(1), Moteus(2), Moteus(3)}, 0.002), 1e6, 5e6);
  CHECK(plan.errors.empty());
  CHECK(plan.warnings.empty());
  CHECK(plan.nominal_load == Approx(3 * (133.2 + 88.6) / 2000));
  CHECK(plan.worst_load == Approx(3 * (command + answer) / 2000));
  // Commands go first, as their ids begin with zeros; the longest that may have begun is one of
  // those that come now and then, text of 64 bytes.
  const double text = 34 + 678 / 5.;
  CHECK(Response(plan, 0x8001) == Approx(200 + text + command));
  CHECK(Response(plan, 0x8003) == Approx(200 + text + 3 * command));
  CHECK_THAT(ToText(plan), Contains("0x00008001") && Contains("data of FD frames at 5e+06 bit/s") &&
                               Contains("470-576") && Contains("all deadlines are met"));
  CHECK(PlanBus(Motors({Moteus(1), Moteus(2), Moteus(3)}, 0.001), 1e6, 5e6).worst_load ==
        Approx(0.7992));
  CHECK(PlanBus(Motors({Moteus(1)}, 0.005), 5e5, 2e6).errors.empty());
}

TEST_CASE("CAN FD on a bus that carries none, and beside those who cannot stand it") {
  CHECK_THAT(PlanBus(Motors({Moteus(1)}), 1e6).errors.front(),
             Contains("'motor1' speaks CAN FD, which the bus does not carry"));
  auto devices = Motors({Moteus(1)}, 0.002);
  devices.push_back(Encoder(5, 2'000));
  const BusPlan plan = PlanBus(devices, 1e6, 5e6);
  CHECK(plan.errors.empty());
  REQUIRE(plan.warnings.size() == 1);
  CHECK_THAT(plan.warnings[0],
             Contains("'motor1' speaks CAN FD and 'encoder5' does not: a controller that cannot"));
}

}  // namespace
}  // namespace plumb
