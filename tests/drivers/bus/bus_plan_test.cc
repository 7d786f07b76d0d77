#include "drivers/bus/bus_plan.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <map>

#include "drivers/protocols/registry.h"
#include "tests/drivers/bus/bus_devices.h"

namespace plumb {
namespace {

using Catch::Contains;

TEST_CASE("a leg at 500 Hz fits: loads and response times as computed by hand") {
  const BusPlan plan = PlanBus(Leg(2'000, 2'000, 5'000), 1e6);
  CHECK(plan.errors.empty());
  CHECK(plan.warnings.empty());
  CHECK(100 * plan.worst_load == Approx(57.655));
  // Node 1's torque waits for any frame (135), heartbeat and estimates (135 each), takes 95, and is
  // up to 200 us late; each further node's for a node's 500 us more.
  CHECK(Response(plan, 0x02E) == Approx(700));
  CHECK(Response(plan, 0x04E) == Approx(1200));
  CHECK(Response(plan, 0x06E) == Approx(1700));
  CHECK_THAT(ToText(plan),
             Contains("57.7 % at worst") && Contains("all deadlines are met") && Contains("0x06e"));
}

TEST_CASE("a leg at 1 kHz does not") {
  const BusPlan plan = PlanBus(Leg(1'000, 1'000, 2'500), 1e6);
  CHECK(std::lround(100 * plan.worst_load) == 111);
  REQUIRE(plan.errors.size() > 1);
  CHECK(plan.errors[0] == "the bus would be loaded to 111 %: use longer periods, or two buses");
  CHECK_THAT(ToText(plan), Contains("later and later"));
}

TEST_CASE("an IMU of higher priority makes others late") {
  // With the factory's ids, at 400 Hz: the whole sample goes before the last node's torque.
  const BusPlan high = PlanBus(Leg(2'000, 2'000, 2'500, 0), 1e6);
  const BusPlan low = PlanBus(Leg(2'000, 2'000, 2'500), 1e6);
  CHECK(Response(low, 0x06E) == Approx(1700));
  CHECK(Response(high, 0x06E) > 2000);
  CHECK(Response(high, 0x181) > 2000);
  CHECK_THAT(high.errors.back(), Contains("may be sent") && Contains("due every 2.00 ms"));
}

TEST_CASE("loads of table rows: ODrives and MIT motors at 1 kHz") {
  // Per ODrive: two frames of 135 bits, a heartbeat of 135 bits every 100 ms, torques every 10 ms.
  for (const auto& [count, percent] : std::map<int, int>{{1, 29}, {2, 57}, {3, 86}, {4, 114}}) {
    std::vector<BusDevice> devices;
    for (int node = 1; node <= count; ++node) {
      devices.push_back(Drive(node, 1'000));
      devices.back().messages[2].layout.length = 8;
    }
    const BusPlan plan = PlanBus(devices, 1e6);
    CHECK(std::ceil(100 * plan.worst_load) == percent);
    CHECK(plan.warnings.empty() == (percent <= 80 || percent > 100));
  }
  const BusPlan mit =
      PlanBus(Motors({MitMotor(0x11, 0x10), MitMotor(0x12, 0x20), MitMotor(0x13, 0x30)}), 1e6);
  CHECK(100 * mit.worst_load == Approx(3 * 27));  // replies of 8 bytes
  CHECK(mit.warnings.size() == 1);
}

TEST_CASE("the revised analysis: the first instance is not always the last to be late") {
  // Table 3 of Davis et al.: three messages of cost 1, periods 2.5, 3.5, 3.5. The third is in time
  // at the first instance (3) and late at the second (3.5 - 2 rounds on): its response time is 3.5,
  // not 3.
  const auto message = [](uint32_t id, int64_t period) {
    return Message(cansimple::kGetIq, id, period, 8);
  };
  const std::vector<BusDevice> devices = {{"a", "x", {message(1, 2500)}, {}},
                                          {"b", "x", {message(2, 3500)}, {}},
                                          {"c", "x", {message(3, 3500)}, {}}};
  const BusPlan plan = PlanBus(devices, 135e3);  // 1 ms per message
  CHECK(Response(plan, 1) / 1000 == Approx(2).margin(1e-3));
  CHECK(Response(plan, 2) / 1000 == Approx(3).margin(1e-3));
  CHECK(Response(plan, 3) / 1000 == Approx(3.5).margin(1e-2));
}

TEST_CASE("an answer is as late as its question, and then some") {
  const BusPlan plan = PlanBus(Motors({MitMotor(0x11, 0x10)}), 1e6);
  // The reply has the higher priority: it waits for the command (135) and takes 135, after the
  // command's own 200 + 135 + 135.
  CHECK(Response(plan, 0x11) == Approx(200 + 135 + 135));
  CHECK(Response(plan, 0x10) == Approx(470 + 135 + 135));
}

TEST_CASE("messages of one id: each answer is as late as its own question") {
  const Layout ask_a{1, "Ask_A"}, ask_b{2, "Ask_B"}, a{1, "A"}, b{2, "B"};
  BusDevice device{"motor",
                   "x",
                   {Message(ask_a, 0x10, 5'000, 8, 200), Message(ask_b, 0x10, 5'000, 8, 200),
                    Message(a, 0x20, 5'000, 8), Message(b, 0x21, 5'000, 8)},
                   {}};
  device.messages[2].answers = 0;
  device.messages[3].answers = 1;
  const BusPlan plan = PlanBus({device}, 1e6);
  // One that has begun, 135 for each, and questions are late by 200.
  CHECK(Response(plan, 0x20) == Approx((200 + 2 * 135) + 135 + 2 * 135 + 135));
  CHECK(Response(plan, 0x21) == Approx((200 + 3 * 135) + 3 * 135 + 135));
}

TEST_CASE("an RMD motor: two questions in every cycle, and readings in turn") {
  const BusPlan plan = PlanBus(Motors({RmdMotor(1)}, 0.002), 1e6);
  const auto response = [&](std::string_view name) {
    return std::ranges::find(plan.rows, name,
                             [](const auto& row) { return row.message.layout.name; })
        ->response;
  };
  // The driver's, behind each other: late by 200, blocked by 135 of an answer, 135 each.
  CHECK(response("Torque") == Approx(200 + 135 + 135));
  CHECK(response("Ask_Angle") == Approx(200 + 135 + 135 + 135));
  CHECK(response("Ask_Status") == Approx(200 + 135 + 2 * 135 + 135));
  // The answers wait for one lower, for those three, and for each other.
  CHECK(response("Torque_Answer") == Approx(470 + 135 + 3 * 135 + 135));
  CHECK(response("Angle") == Approx(605 + 135 + 3 * 135 + 135 + 135));
  CHECK(plan.errors.empty());
  CHECK(PlanBus(Motors({RmdMotor(1), RmdMotor(2), RmdMotor(3)}, 0.004), 1e6).errors.empty());
}

TEST_CASE("collisions name both and the id") {
  SECTION("factory ids of an ODrive and an Xsens") {
    MotorDescription motor;
    motor.protocol = "cansimple";
    motor.node = 1;
    auto devices = Motors({motor});
    devices.push_back(Imu(0, 5'000));
    const BusPlan plan = PlanBus(devices, 1e6);
    REQUIRE_FALSE(plan.errors.empty());
    CHECK(plan.errors[0] == "CAN id 0x021: 'motor1' sends Heartbeat and 'imu' sends Quaternion");
  }
  SECTION("an id that the drive does not use, but owns") {
    MotorDescription motor;
    motor.protocol = "cansimple";
    motor.node = 4;
    auto devices = Motors({motor});
    devices.push_back({"encoder", "cia406", {Message(cia406::kEmergency, 0x08A, 0, 8)}, {}});
    const BusPlan plan = PlanBus(devices, 1e6);
    REQUIRE(plan.errors.size() == 1);
    CHECK(plan.errors[0] ==
          "CAN id 0x08a: 'encoder' sends EMCY, but ids 0x080 to 0x09f are 'motor4's");
  }
  SECTION("two drives of one node, two motors of one id") {
    MotorDescription motor;
    motor.protocol = "cansimple";
    motor.node = 2;
    CHECK_THAT(PlanBus(Motors({motor, motor}), 1e6).errors.front(), Contains("0x041"));
    CHECK_THAT(PlanBus(Motors({MitMotor(3, 0x10), MitMotor(3, 0x10)}), 1e6).errors.front(),
               Contains("0x003") && Contains("obeys Command"));
    CHECK_THAT(PlanBus(Motors({RmdMotor(3), RmdMotor(3)}, 0.01), 1e6).errors.front(),
               Contains("0x143") && Contains("obeys Torque"));
    CHECK_THAT(PlanBus(Motors({Moteus(3), Moteus(3)}), 1e6, 5e6).errors.front(),
               Contains("0x8003") && Contains("obeys Command"));
  }
  SECTION("a MIT motor's replies are another's commands") {
    CHECK_THAT(PlanBus(Motors({MitMotor(3, 0), MitMotor(4, 3)}), 1e6).errors.front(),
               Contains("0x003: 'motor3' obeys Command and 'motor4' sends Reply"));
  }
  SECTION("an ODrive's estimates are an RMD motor's commands of motion") {
    MotorDescription motor;
    motor.protocol = "cansimple";
    motor.node = 32;
    CHECK(PlanBus(Motors({motor, RmdMotor(9)}, 0.01), 1e6).errors.front() ==
          "CAN id 0x409 is both 'motor32's and 'motor9's");
  }
  SECTION("MIT replies on one id: allowed, and warned of") {
    const BusPlan plan = PlanBus(Motors({MitMotor(3, 0), MitMotor(4, 0)}, 0.002), 1e6);
    CHECK(plan.errors.empty());
    REQUIRE(plan.warnings.size() == 1);
    CHECK_THAT(plan.warnings[0], Contains("0x000") && Contains("motor3") && Contains("motor4"));
  }
  SECTION("NMT is for all encoders, and nobody else") {
    SensorDescription sensor;
    sensor.protocol = "cia406";
    sensor.period = 0.002;
    std::vector<BusDevice> devices;
    for (const int node : {1, 2}) {
      sensor.node = node;
      sensor.name = "encoder" + std::to_string(node);
      devices.push_back(SensorBusDevice(sensor));
    }
    CHECK(PlanBus(devices, 1e6).errors.empty());
    devices.push_back(Motors({MitMotor(3, 0)})[0]);
    CHECK_THAT(PlanBus(devices, 1e6).errors.front(),
               Contains("0x000: 'encoder1' obeys NMT and 'motor3' sends Reply"));
  }
  SECTION("whatever ends with a moteus' number is for it") {
    auto devices = Motors({Moteus(1)});
    SensorDescription sensor;
    sensor.name = "encoder";
    sensor.protocol = "cia406";
    sensor.period = 0.002;
    sensor.node = 1;
    devices.push_back(SensorBusDevice(sensor));
    CHECK_THAT(PlanBus(devices, 1e6, 5e6).errors.front(),
               Contains("'encoder'") && Contains("are 'motor1's"));
  }
  SECTION("a standard and an extended frame never collide") {
    BusDevice a{"a", "x", {Message(cansimple::kGetIq, 0x123, 1000, 8)}, {}}, b = a;
    b.name = "b";
    b.messages[0].extended = true;
    CHECK(PlanBus({a, b}, 1e6).errors.empty());
  }
}

TEST_CASE("slower buses are fuller") {
  CHECK(PlanBus(Leg(2'000, 2'000, 5'000), 5e5).worst_load == Approx(2 * 0.57655));
}

TEST_CASE("the robots we ship fit their buses") {
  const char* source = std::getenv("PLUMBLINE_SOURCE");
  for (const char* name :
       {"pendulum", "pendulum/moteus.toml", "pendulum/rmd.toml", "double_pendulum", "cartpole",
        "hopper", "hopper/two_buses.toml", "hopper/moteus.toml"}) {
    INFO(name);
    const RobotDescription robot =
        LoadRobot(std::string(source ? source : ".") + "/robots/" + name);
    for (size_t bus = 0; bus < robot.buses.size(); ++bus) {
      const BusPlan plan = PlanBus(robot, bus);
      INFO(ToText(plan));
      CHECK(plan.errors.empty());
      CHECK(plan.warnings.empty());
    }
  }
  CHECK_THROWS_AS(MotorBusDevice(MotorDescription{"nonsense"}, DriverSettings{}),
                  std::invalid_argument);
}

TEST_CASE("of what is asked for in turn one message waits at a time") {
  // Ten devices with an answer of 135 us each, above a message that is due every millisecond.
  const auto plan = [](bool polled) {
    std::vector<BusDevice> devices;
    for (uint32_t i = 0; i < 10; ++i) {
      BusMessage answer = Message(cansimple::kGetTemperature, 0x10 + i, 100'000, 8);
      answer.polled = polled;
      devices.push_back({"drive" + std::to_string(i), "", {answer}, {}});
    }
    devices.push_back(
        {"sensor", "", {Message(cansimple::kGetEncoderEstimates, 0x100, 1'000, 8)}, {}});
    return PlanBus(devices, 1e6);
  };
  CHECK_THAT(plan(false).errors.at(0), Contains("'sensor'"));
  CHECK(Response(plan(false), 0x100) == 11 * 135);
  CHECK(plan(true).errors.empty());
  CHECK(Response(plan(true), 0x100) == 2 * 135);
  // The first and the last of them may both find the wire taken, and nothing above them.
  CHECK(Response(plan(true), 0x10) == 2 * 135);
  CHECK(Response(plan(true), 0x19) == 2 * 135);
  // They are a load, every one of them.
  CHECK(plan(true).worst_load == Approx(plan(false).worst_load));
}

}  // namespace
}  // namespace plumb
