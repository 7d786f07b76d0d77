#include "sim/virtual/virtual_robot.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "common/random.h"
#include "drivers/protocols/cansimple.h"
#include "sim/parameters.h"
#include "sim/simulator.h"
#include "sim/virtual/simbody_plant.h"
#include "tests/sim/robots.h"
#include "tests/sim/scalar.h"

namespace plumb {
namespace {

using cansimple::Make;
using Eigen::VectorXd;

constexpr double kTurn = 2 * std::numbers::pi;
// a utime, [us]; a multiple of the measurement period
constexpr int64_t kStart = 1'700'000'000'000'000;
constexpr int kNode = 1;

RobotDescription Pendulum() { return LoadPendulum("robot.toml"); }

/// A virtual pendulum and its bus.
struct Bench {
  explicit Bench(const RobotDescription& description = Pendulum())
      : truth(HiddenParameters(description, 1)), robot(description, truth, kStart) {}

  void Send(const Frame& frame, int64_t at) { robot.Receive(0, frame, kStart + at, {&out, 1}); }
  void Advance(int64_t to) { robot.Advance(kStart + to, {&out, 1}); }
  void Arm(int64_t at) {
    Send(Make(cansimple::kClearErrors, kNode), at);
    Send(Make(cansimple::kSetControllerMode, kNode,
              {cansimple::kTorqueControl, cansimple::kPassthrough}),
         at);
    Send(Make(cansimple::kSetInputTorque, kNode, {0}), at);
    Send(Make(cansimple::kSetAxisState, kNode, {cansimple::kClosedLoopControl}), at);
    REQUIRE(robot.devices()[0]->armed());
  }
  /// Values of the messages of this layout that have been sent.
  std::vector<FieldValues> Sent(const Layout& layout) const {
    std::vector<FieldValues> values;
    for (const Frame& frame : out.frames()) {
      if (!frame.remote && frame.id == (kNode << 5 | layout.command))
        values.push_back(*DecodePayload(layout, frame));
    }
    return values;
  }

  VectorXd truth;
  FrameBatch out;
  VirtualRobot robot;
};

}  // namespace

TEST_CASE("the virtual robot moves by its hidden parameters") {
  const RobotDescription description = Pendulum();
  Bench bench(description);
  REQUIRE(bench.robot.Place(1, Scalar(1), Scalar(-2)));
  bench.Arm(0);
  bench.Send(Make(cansimple::kSetInputTorque, kNode, {1.5}), 0);
  bench.Advance(50'000);
  RobotDescription fine = description;
  fine.simulation.substep = 1e-4;
  Simulator simulator(fine);
  simulator.SetParameters(bench.truth);
  simulator.SetState(Scalar(1), Scalar(-2));
  simulator.Step(Scalar(1.5), 0.05);
  CHECK(bench.robot.q()[0] == Approx(simulator.q()[0]).epsilon(1e-7));
  CHECK(bench.robot.v()[0] == Approx(simulator.v()[0]).epsilon(1e-6));
}

TEST_CASE("a torque acts from the arrival of its frame, however late the process wakes") {
  const auto run = [](bool lazy) {
    Bench bench;
    bench.Arm(0);
    if (!lazy) {
      for (int64_t t = 0; t < 23'123; t += 250) bench.Advance(t);
    }
    bench.Send(Make(cansimple::kSetInputTorque, kNode, {2}), 23'123);
    if (!lazy) bench.Advance(30'001);
    bench.Send(Make(cansimple::kSetInputTorque, kNode, {-1}), 47'777);
    bench.Advance(60'000);
    return bench.robot.q()[0];
  };
  CHECK(run(true) == run(false));
  // 24.654 ms at 2 Nm and 12.223 ms at -1 Nm, from rest upright, where gravity has hardly begun to
  // act.
  const Eigen::VectorXd truth = HiddenParameters(Pendulum(), 1);
  const double gain = 3 / (truth[1] * truth[2] * truth[2]), a = 0.024654, b = 0.012223;
  CHECK(run(true) == Approx(gain * (2 * (a * a / 2 + a * b) - b * b / 2)).epsilon(0.01));
}

TEST_CASE("the encoder is read at multiples of its period, and sent whenever the process wakes") {
  Bench punctual, late;
  for (Bench* bench : {&punctual, &late}) REQUIRE(bench->robot.Place(1, Scalar(0.5), Scalar(3)));
  for (int64_t t = 0; t <= 40'000; t += 500) punctual.Advance(t);
  late.Advance(40'900);
  const auto expected = punctual.Sent(cansimple::kGetEncoderEstimates);
  const auto estimates = late.Sent(cansimple::kGetEncoderEstimates);
  REQUIRE(expected.size() == 8);
  REQUIRE(estimates.size() == 8);
  SimbodyPlant plant(Model(Pendulum()).Describe(late.truth));
  plant.SetState(Scalar(0.5), Scalar(3));
  for (size_t i = 0; i < 8; ++i) {
    REQUIRE(plant.Advance(Scalar(0), 0.005));
    CHECK(estimates[i][0] == expected[i][0]);
    const double count = 1.0 / 16384;
    CHECK(std::abs(estimates[i][0] - plant.q()[0] / kTurn) <= count / 2 * 1.001);
    CHECK(estimates[i][0] / count == std::round(estimates[i][0] / count));
    CHECK(estimates[i][1] == Approx(plant.v()[0] / kTurn).margin(0.02));
  }
  CHECK(late.Sent(cansimple::kHeartbeat).size() == 2);
}

TEST_CASE("gear, sign and offset lie between joint and motor") {
  RobotDescription description = Pendulum();
  description.joints[0].motor = {"cansimple", kNode, 6, -1, 0.3};
  Bench geared(description), direct;
  for (Bench* bench : {&geared, &direct}) {
    REQUIRE(bench->robot.Place(1, Scalar(0.8), Scalar(1)));
    bench->Arm(0);
  }
  geared.Send(Make(cansimple::kSetInputTorque, kNode, {-0.25}), 0);
  direct.Send(Make(cansimple::kSetInputTorque, kNode, {1.5}), 0);
  geared.Advance(20'000);
  direct.Advance(20'000);
  CHECK(geared.robot.q()[0] == Approx(direct.robot.q()[0]).epsilon(1e-12));
  const FieldValues estimate = geared.Sent(cansimple::kGetEncoderEstimates).back();
  CHECK(estimate[0] == Approx(-6 * (geared.robot.q()[0] - 0.3) / kTurn).margin(1e-4));
  CHECK(estimate[1] == Approx(-6 * geared.robot.v()[0] / kTurn).margin(0.05));
}

TEST_CASE("a motor saturates at the joint's effort limit") {
  Bench strong, limit;
  strong.Arm(0);
  limit.Arm(0);
  strong.Send(Make(cansimple::kSetInputTorque, kNode, {1000}), 0);
  limit.Send(Make(cansimple::kSetInputTorque, kNode, {2}), 0);
  strong.Advance(50'000);
  limit.Advance(50'000);
  CHECK(strong.robot.q() == limit.robot.q());
}

TEST_CASE("without setpoints the watchdog stops the torque on time, though the process sleeps") {
  Bench sleeping, stopped;
  for (Bench* bench : {&sleeping, &stopped}) {
    bench->Arm(0);
    bench->Send(Make(cansimple::kSetInputTorque, kNode, {1}), 7'000);
  }
  stopped.Send(Make(cansimple::kSetAxisState, kNode, {cansimple::kIdle}),
               107'000);  // when the watchdog expires
  sleeping.Advance(150'000);
  stopped.Advance(150'000);
  CHECK_FALSE(sleeping.robot.devices()[0]->armed());
  CHECK(sleeping.robot.devices()[0]->disarm_reason() == cansimple::kWatchdogTimerExpired);
  CHECK(sleeping.robot.q()[0] == Approx(stopped.robot.q()[0]).epsilon(1e-12));
  CHECK(sleeping.robot.q()[0] != 0);
}

TEST_CASE("a placing wish is granted once, and only a sane one") {
  Bench bench;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(bench.robot.Place(1, Scalar(nan), Scalar(0)));
  CHECK_FALSE(bench.robot.Place(1, Scalar(0), Scalar(1e300)));
  CHECK_FALSE(bench.robot.Place(1, VectorXd::Zero(2), VectorXd::Zero(2)));
  CHECK_FALSE(bench.robot.Place(1, VectorXd(), VectorXd()));
  CHECK(bench.robot.q()[0] == 0);
  CHECK(bench.robot.Place(0, Scalar(2), Scalar(1)));
  CHECK(bench.robot.q()[0] == 2);
  bench.Advance(10'000);
  CHECK(bench.Sent(cansimple::kGetEncoderEstimates).back()[1] == Approx(1.1 / kTurn).margin(0.03));
  const double moved = bench.robot.q()[0];
  CHECK(bench.robot.Place(0, Scalar(2), Scalar(1)));
  CHECK(bench.robot.q()[0] == moved);
  CHECK(bench.robot.Place(7, Scalar(-1), Scalar(0)));
  CHECK(bench.robot.q()[0] == -1);
}

TEST_CASE("requests are answered with the shaft as it is") {
  Bench bench;
  REQUIRE(bench.robot.Place(1, Scalar(1), Scalar(5)));
  bench.Send(cansimple::MakeRequest(cansimple::kGetEncoderEstimates, kNode), 2'500);
  const auto answers = bench.Sent(cansimple::kGetEncoderEstimates);
  REQUIRE(answers.size() == 1);
  CHECK(answers[0][0] == Approx((1 + 5 * 0.0025) / kTurn).margin(1e-4));
}

TEST_CASE("after a gap in time the drives have rebooted and the robot is where it was") {
  for (const int64_t jump : {int64_t{60'000'000}, int64_t{-60'000'000}}) {
    Bench bench;
    REQUIRE(bench.robot.Place(1, Scalar(1), Scalar(0)));
    bench.Arm(1000);
    const double before = bench.robot.q()[0];
    bench.Advance(jump);
    CHECK(bench.robot.q()[0] == before);
    CHECK_FALSE(bench.robot.devices()[0]->armed());
    CHECK(bench.robot.time() == kStart + jump);
    bench.out.Clear();
    bench.Advance(jump + 20'000);
    CHECK(bench.Sent(cansimple::kGetEncoderEstimates).size() == 4);
  }
  // A little step back only waits.
  Bench bench;
  bench.Advance(10'000);
  bench.Advance(9'000);
  CHECK(bench.robot.time() == kStart + 10'000);
  CHECK(bench.robot.NextEvent() == kStart + 15'000);
}

TEST_CASE("what would be too late is not sent") {
  Bench bench;
  bench.Advance(2'000'000);
  CHECK(bench.Sent(cansimple::kGetEncoderEstimates).size() == 11);
  CHECK(bench.robot.NextEvent() == kStart + 2'005'000);
}

TEST_CASE("garbage on the bus moves nothing") {
  Bench bench;
  bench.Arm(0);
  Random random(21);
  int64_t t = 0;
  for (int i = 0; i < 20'000; ++i) {
    Frame frame;
    frame.id = random.Bits() & (i % 3 == 0 ? 0x1FFFFFFF : 0x7FF);
    frame.extended = (random.Bits() & 7) == 0;
    frame.remote = (random.Bits() & 7) == 0;
    frame.error = (random.Bits() & 15) == 0;
    frame.fd = (random.Bits() & 15) == 0;
    frame.length = static_cast<uint8_t>(random.Bits() & 0xFF);  // beyond 8, even beyond 64
    for (uint8_t& byte : frame.data) byte = static_cast<uint8_t>(random.Bits());
    // Ours, but not a setpoint or a request for a state, which would be obeyed.
    if (i % 3 == 1) frame.id = kNode << 5 | (frame.id & 0x1F);
    const uint32_t command = frame.id & 0x1F;
    if (command == cansimple::kSetInputTorque.command)
      frame.length = static_cast<uint8_t>(frame.length & 3);
    bench.out.Clear();
    t += random.Bits() & 0xFF;
    bench.Send(frame, t);
    for (const Frame& answer : bench.out.frames()) REQUIRE(IsWellFormed(answer));
  }
  CHECK(bench.robot.devices()[0]->Effort() == 0);
  CHECK(bench.robot.devices()[0]->rejected() > 100);
  CHECK(bench.robot.q().allFinite());
}

TEST_CASE("equal seeds and frames give equal robots to the bit") {
  const auto run = [] {
    Bench bench;
    bench.Arm(10);
    for (int i = 1; i < 20; ++i)
      bench.Send(Make(cansimple::kSetInputTorque, kNode, {0.1 * i}), 1777 * i);
    return bench.robot.q()[0];
  };
  CHECK(run() == run());
}

TEST_CASE("a protocol without a virtual drive is refused") {
  RobotDescription description = Pendulum();
  description.joints[0].motor.protocol = "dynamixel";
  CHECK_THROWS_WITH(VirtualRobot(description, HiddenParameters(description, 1), kStart),
                    Catch::Contains("'pivot'") && Catch::Contains("known: cansimple"));
}

}  // namespace plumb
