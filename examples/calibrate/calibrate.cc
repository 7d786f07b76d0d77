// Plumbline's simulator and calibration in a program of one's own: a robot with parameters that
// nobody has told the calibration is moved at random, and the motion tells what they are.
//
//   calibrate robots/pendulum
#include <fmt/format.h>

#include <cstdlib>
#include <exception>
#include <iostream>
#include <span>
#include <string>
#include <vector>

#include "calibrator/results/calibration.h"
#include "common/gaussian.h"
#include "common/random.h"
#include "robot/description.h"
#include "robot/parameter_distribution.h"
#include "sim/simulator.h"

namespace {

constexpr int kSteps = 100;
constexpr double kNoise = 1e-3;  // [rad and rad/s, or m and m/s] standard deviation of a reading

/// Random efforts, held for a control period each, on a simulator with those parameters.
plumb::Rollout MoveAtRandom(const plumb::RobotDescription& robot, const Eigen::VectorXd& truth) {
  plumb::Simulator simulator(robot);
  simulator.SetParameters(truth);
  plumb::Random random(1, {0});
  const auto read = [&](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    return x + kNoise * plumb::StandardNormals(x.size(), 1, random);
  };
  plumb::Rollout rollout;
  Eigen::VectorXd q = read(simulator.q()), v = read(simulator.v());
  for (int step = 0; step < kSteps; ++step) {
    Eigen::VectorXd effort = Eigen::VectorXd::Zero(robot.num_velocities());
    const Eigen::VectorXd limits = robot.effort_limits();
    const std::vector<int> driven = robot.driven();
    for (size_t i = 0; i < driven.size(); ++i)
      effort(driven[i]) = random.Uniform(-1, 1) * limits(static_cast<Eigen::Index>(i));
    plumb::Transition transition;
    transition.step = step;
    transition.q = q, transition.v = v;
    transition.efforts = {{robot.task.period, effort}};
    simulator.Step(transition.efforts);
    q = read(simulator.q()), v = read(simulator.v());
    transition.next_q = q, transition.next_v = v;
    for (Eigen::VectorXd* sd : {&transition.q_sd, &transition.next_q_sd})
      sd->setConstant(robot.num_positions(), kNoise);
    for (Eigen::VectorXd* sd : {&transition.v_sd, &transition.next_v_sd})
      sd->setConstant(robot.num_velocities(), kNoise);
    rollout.transitions.push_back(transition);
  }
  return rollout;
}

int Main(const std::string& folder) {
  const plumb::RobotDescription robot = plumb::LoadRobot(folder);
  const plumb::Gaussian prior = plumb::PriorGaussian(robot);
  // Half a standard deviation from what was to be expected.
  const Eigen::VectorXd truth =
      robot.ToPhysical(prior.mean + 0.5 * prior.covariance.diagonal().cwiseSqrt());
  plumb::Log log;
  log.name = "random motion";
  log.rollouts = {MoveAtRandom(robot, truth)};

  plumb::CalibrationOptions options;
  options.method = "laplace";
  const plumb::Findings findings = plumb::Calibrate(robot, std::span(&log, 1), options);
  const Eigen::VectorXd found = robot.ToPhysical(plumb::Moments(findings.posterior).mean);
  for (size_t i = 0; i < robot.parameters.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    fmt::print("{:20} {:8.4f} {}, in truth {:.4f}\n", robot.parameters[i].name, found(at),
               robot.parameters[i].unit, truth(at));
  }
  fmt::print("discrepancy {:.2f}\n", findings.discrepancy);
  return findings.discrepancy < 2 ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: calibrate ROBOT, a robot's folder\n";
    return 2;
  }
  try {
    return Main(argv[1]);
  } catch (const std::exception& error) {
    std::cerr << "calibrate: " << error.what() << "\n";
    return EXIT_FAILURE;
  }
}
