// Parts of a virtual robot that no model knows, as its drives feel it.
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "drivers/protocols/cansimple.h"
#include "sim/model.h"
#include "sim/virtual/effort_delay.h"
#include "sim/virtual/virtual_plant.h"
#include "sim/virtual/virtual_robot.h"
#include "tests/sim/robots.h"
#include "tests/sim/scalar.h"

namespace plumb {
namespace {

using cansimple::Make;
using Eigen::VectorXd;

constexpr int64_t kBegin = 1'700'000'000'000'000;

RobotDescription UnmodelledPendulum(UnmodelledJoint unmodelled) {
  RobotDescription robot = LoadPendulum("robot.toml");
  robot.simulation.gravity = 0;
  std::erase_if(robot.parameters,
                [](const auto& parameter) { return parameter.name == "gravity"; });
  robot.virtual_robot.hidden.clear();
  unmodelled.joint = 0;
  robot.virtual_robot.joints = {unmodelled};
  return robot;
}

double Inertia(const RobotDescription& robot) {
  const LinkDescription link = Model(robot).Describe(Model(robot).parameters().means()).links[1];
  return link.inertia(1, 1) + link.mass * link.center_of_mass.squaredNorm();
}

/// Armed at 0.
struct UnmodelledBench {
  explicit UnmodelledBench(const RobotDescription& robot)
      : virtual_robot(robot, Model(robot).parameters().means(), kBegin) {
    Send(Make(cansimple::kClearErrors, 1), 0);
    Send(Make(cansimple::kSetControllerMode, 1,
              {cansimple::kTorqueControl, cansimple::kPassthrough}),
         0);
    Send(Make(cansimple::kSetInputTorque, 1, {0}), 0);
    Send(Make(cansimple::kSetAxisState, 1, {cansimple::kClosedLoopControl}), 0);
    REQUIRE(virtual_robot.devices()[0]->armed());
  }
  void Send(const Frame& frame, int64_t at) {
    virtual_robot.Receive(0, frame, kBegin + at, {&out, 1});
  }
  void Torque(double torque, int64_t at) {
    Send(Make(cansimple::kSetInputTorque, 1, {torque}), at);
  }
  /// The position at the latest event until then [rad], and how long that was ago.
  double At(int64_t time) {
    virtual_robot.Advance(kBegin + time, {&out, 1});
    REQUIRE(virtual_robot.time() == kBegin + time);
    return virtual_robot.q()[0];
  }

  FrameBatch out;
  VirtualRobot virtual_robot;
};

TEST_CASE("friction that no model knows stops a swing where its work has used up the energy") {
  const RobotDescription robot = UnmodelledPendulum({.friction = 0.1});
  VirtualPlant mechanism(Model(robot).Describe(Model(robot).parameters().means()));
  mechanism.SetState(Scalar(0), Scalar(2));
  REQUIRE(mechanism.Advance(Scalar(0), 20));
  CHECK(std::abs(mechanism.v()[0]) < 1e-3);
  CHECK(mechanism.q()[0] == Approx(Inertia(robot) * 4 / 2 / 0.1).epsilon(0.01));
}

TEST_CASE("a delay that no model knows shifts an effort by itself, to the microsecond") {
  const double inertia = Inertia(UnmodelledPendulum({}));
  for (const double delay : {0.0, 0.004, 0.012345, 0.1}) {
    UnmodelledBench bench(UnmodelledPendulum({.delay = delay}));
    bench.Torque(1.5, 10'007);
    bench.Torque(0, 20'011);  // overtakes nothing
    bench.Torque(0, 60'000);
    bench.Torque(0, 110'000);
    const double speed = 1.5 / inertia * 10'004e-6;
    // Coasting since the middle of the push.
    const double since = 150e-3 - delay - (10'007 + 20'011) / 2e6;
    INFO("delay " << delay);
    CHECK(bench.At(150'000) == Approx(speed * since).epsilon(1e-9));
  }
}

TEST_CASE("efforts on their way are forgotten when the power goes") {
  EffortDelay delay(UnmodelledPendulum({.delay = 0.004}));
  delay.Make(0, 1, 1000);
  delay.Make(0, 1, 1500);  // no change
  delay.Make(0, 2, 2000);
  CHECK(delay.NextChange() == 5000);
  delay.Take(4999);
  CHECK(delay.acting()[0] == 0);
  delay.Take(5000);
  CHECK(delay.acting()[0] == 1);
  CHECK(delay.NextChange() == 6000);
  delay.Clear();
  CHECK(delay.acting()[0] == 0);
  CHECK(delay.NextChange() == std::numeric_limits<int64_t>::max());
}

TEST_CASE("with backlash a drive's encoder reads the rotor, and its torque moves that first") {
  const double rotor = 0.01, gap = 0.02;
  UnmodelledBench bench(UnmodelledPendulum({.backlash = gap, .rotor = rotor}));
  bench.Torque(0.05, 10'000);
  bench.At(50'000);
  const double expected = 0.05 / rotor * 0.04 * 0.04 / 2;  // less than half the gap
  REQUIRE(expected < gap / 2);
  CHECK(bench.virtual_robot.q()[0] == 0);
  FieldValues last{};
  for (const Frame& frame : bench.out.frames()) {
    if (!frame.remote && frame.id == (1 << 5 | cansimple::kGetEncoderEstimates.command)) {
      last = *DecodePayload(cansimple::kGetEncoderEstimates, frame);
    }
  }
  CHECK(last[0] * 2 * std::numbers::pi == Approx(expected).margin(2 * std::numbers::pi / 16384));
}

}  // namespace
}  // namespace plumb
