#include "calibrator/fit/step_errors.h"

#include <catch2/catch.hpp>
#include <memory>

#include "common/random.h"
#include "sim/simulator.h"
#include "tests/calibrator/synthetic.h"

namespace plumb {
namespace {

// What sensors read of the pendulum, whose efforts change every 50 ms.
Rollout Readings(const RobotDescription& robot, const Eigen::VectorXd& physical, int steps) {
  Simulator simulator(robot);
  simulator.SetParameters(physical);
  Random random(3);
  simulator.SetState(Eigen::VectorXd::Constant(1, 0.5), Eigen::VectorXd::Zero(1));
  Rollout rollout;
  const auto read = [&](Eigen::VectorXd* q, Eigen::VectorXd* v) {
    const Simulator::State reading = simulator.Reading();
    *q = reading.q, *v = reading.v;
  };
  for (int i = 0; i < steps; ++i) {
    Transition t;
    t.step = i;
    t.efforts = {{0.05, Eigen::VectorXd::Constant(1, random.Uniform(-2, 2))}};
    read(&t.q, &t.v);
    simulator.Step(t.efforts);
    read(&t.next_q, &t.next_v);
    t.q_sd = t.next_q_sd = t.v_sd = t.next_v_sd = Eigen::VectorXd::Constant(1, 1e-4);
    rollout.transitions.push_back(t);
  }
  return rollout;
}

double LargestError(const RobotDescription& robot, const Rollout& rollout, size_t from,
                    const Eigen::VectorXd& physical) {
  const SortedErrors sorted =
      CollectErrors(std::make_shared<Model>(robot), physical, {&rollout, 1}, 0);
  REQUIRE(sorted.free.errors.size() == rollout.transitions.size());
  double largest = 0;
  for (size_t i = from; i < sorted.free.errors.size(); ++i)
    largest = std::max(largest, sorted.free.errors[i].cwiseAbs().maxCoeff());
  return largest;
}

TEST_CASE("the right simulator leaves no error of one step, whatever sensors and drives do") {
  RobotDescription robot = Pendulum();
  Eigen::VectorXd physical(robot.parameters.size());
  for (Eigen::Index i = 0; i < physical.size(); ++i)
    physical(i) = robot.parameters[static_cast<size_t>(i)].mean;
  JointDynamics& pivot = robot.joints[0].dynamics;
  SECTION("sensors with a bias") { pivot.sensor_bias = 0.3; }
  SECTION("efforts that are late by more than two steps") { pivot.delay = 0.12; }
  SECTION("both, and sensors that are late") {
    pivot.sensor_bias = 0.3, pivot.delay = 0.12, pivot.sensor_delay = 0.001;
  }
  const Rollout rollout = Readings(robot, physical, 40);
  // what was commanded before the first transition, nothing, is not known
  CHECK(LargestError(robot, rollout, 3, physical) < 3e-4);  // second order in the sensors' delay
  pivot.sensor_bias = pivot.delay = pivot.sensor_delay = 0;
  CHECK(LargestError(robot, rollout, 3, physical) > 1e-2);
}

}  // namespace
}  // namespace plumb
