// What a log can have that makes a posterior worthless: it is said, or does no harm.

#include <catch2/catch.hpp>

#include "calibrator/fit/estimated_noise.h"
#include "calibrator/motion/still_readings.h"
#include "calibrator/results/summary.h"
#include "sim/simulator.h"
#include "tests/calibrator/results/swinging.h"

namespace plumb {
namespace {

std::string Words(const Findings& findings) {
  std::string words;
  for (const std::string& warning : findings.warnings) words += warning + "\n";
  return words;
}

/// Under efforts that last for whole control steps, as a substep is no longer than an effort is.
Rollout Steady(const RobotDescription& robot, uint32_t stream) {
  Rollout rollout = SyntheticRollout(robot, kSwingingTruth, 60, 1e-3, 5e-3, stream);
  Random random(18, {stream});
  const auto noisy = [&](double x, double sd) {
    return Eigen::VectorXd::Constant(1, x + sd * random.Normal());
  };
  Simulator simulator(robot);
  simulator.SetParameters(kSwingingTruth);
  simulator.SetState(rollout.transitions[0].q, rollout.transitions[0].v);
  Eigen::VectorXd q = rollout.transitions[0].q, v = rollout.transitions[0].v;
  for (Transition& t : rollout.transitions) {
    t.q = q, t.v = v;
    t.efforts = {{0.05, t.efforts[0].effort}};
    simulator.Step(t.efforts);
    t.next_q = q = noisy(simulator.q()(0), 1e-3), t.next_v = v = noisy(simulator.v()(0), 5e-3);
  }
  return rollout;
}

TEST_CASE("efforts of the wrong sign fit an absurd robot, which is not trusted") {
  Log log = Swinging("sign", kSwingingTruth, 6, 40);
  const Findings right = Of({log});
  CHECK(Trustworthy(right));
  CHECK_THAT(Words(right), !Catch::Contains("contradict"));
  for (Rollout& rollout : log.rollouts) {
    for (Transition& t : rollout.transitions) {
      for (EffortSegment& segment : t.efforts) segment.effort *= -1;
    }
  }
  const Findings wrong = Of({log});
  INFO(Words(wrong));
  CHECK_FALSE(Trustworthy(wrong));
  CHECK((wrong.misspecification.alarm || Words(wrong).find("contradict") != std::string::npos));
}

TEST_CASE(
    "a posterior four of the prior's standard deviations away says so, parameter by parameter") {
  const RobotDescription robot = Pendulum();
  Findings findings = Of({Swinging("a", kSwingingTruth, 2, 0)});
  CHECK(Contradiction(findings, robot).empty());
  findings.posterior = {{1}, {findings.prior}};
  CHECK(DistancesFromPrior(findings).norm() == 0);
  const double sd = std::sqrt(findings.prior.covariance(1, 1));
  findings.posterior.components[0].mean(1) += 11 * sd;
  CHECK(DistancesFromPrior(findings)(1) == Approx(11));
  const std::string said = Contradiction(findings, robot);
  CHECK_THAT(said, Catch::Contains(robot.parameters[1].name + " (11 sd more than its mean)"));
  CHECK_THAT(said, !Catch::Contains(robot.parameters[0].name));
  CHECK_FALSE(Trustworthy(findings));
}

TEST_CASE("efforts that stand a row late are found, and nothing that they teach is trusted") {
  Log log = Swinging("late", kSwingingTruth, 6, 60);
  CHECK(Of({log}).efforts.rows == 0);
  for (Rollout& rollout : log.rollouts) {
    auto& t = rollout.transitions;
    for (size_t k = t.size(); k-- > 1;) t[k].efforts = t[k - 1].efforts;
  }
  const Findings f = Of({log});
  INFO(Words(f));
  CHECK(f.efforts.rows == 1);
  CHECK(f.efforts.left < 0.2);
  CHECK_THAT(Words(f),
             Catch::Contains("efforts stand in the wrong rows: with those of the row after"));
  CHECK_FALSE(Trustworthy(f));
}

TEST_CASE("of a column that never changed nothing is learnt") {
  const RobotDescription robot = Pendulum();
  Log log = Swinging("still", kSwingingTruth, 6, 40);
  for (Rollout& rollout : log.rollouts) {
    for (Transition& t : rollout.transitions) t.v(0) = t.next_v(0) = 0;
  }
  const Findings f = Of({log});
  INFO(Words(f));
  CHECK_THAT(Words(f), Catch::Contains("nothing is learnt from what never changed") &&
                           Catch::Contains("v/" + robot.joints[0].name));
  std::vector<Rollout> all(1), none;
  all[0].transitions.assign(3, log.rollouts[0].transitions[0]);
  for (Transition& t : all[0].transitions) t.next_q = t.q;
  CHECK(ForgetStill(robot, &all).empty());  // of nothing that moves nothing is forgotten
  CHECK(ForgetStill(robot, &none).empty());
}

TEST_CASE("two readings of hundreds that are nonsense raise no alarm") {
  Log log = Swinging("knocks", kSwingingTruth, 6, 60);
  const auto spoil = [](Rollout& rollout, size_t reading) {
    rollout.transitions[reading - 1].next_q(0) += 30;
    rollout.transitions[reading].q(0) += 30;
  };
  spoil(log.rollouts[1], 20), spoil(log.rollouts[4], 33);
  const Findings f = Of({log});
  INFO(f.misspecification.summary);
  CHECK_FALSE(f.misspecification.alarm);
  CHECK_THAT(f.misspecification.summary, Catch::Contains("outliers"));
  CHECK(f.gap.residual == nullptr);
  CHECK(f.noise_sd(0) == Approx(1e-3).epsilon(0.3));
}

TEST_CASE("steps of the simulator that are too long are told from a robot that takes such steps") {
  RobotDescription coarse = Pendulum();
  coarse.simulation.integrator = SimulationSettings::Integrator::kSemiImplicit;
  coarse.simulation.substep = 0.05;
  RobotDescription fine = coarse;
  fine.simulation.substep = 0.0005;
  CalibrationOptions options;
  options.horizons = {1, 5};
  const auto calibrate = [&](const RobotDescription& robot) {
    Log log;
    log.name = "a";
    for (uint32_t i = 0; i < 6; ++i) log.rollouts.push_back(Steady(robot, 80 + i));
    return Calibrate(coarse, std::vector<Log>{log}, options);
  };
  const Findings robot = calibrate(fine), twin = calibrate(coarse);
  INFO(Words(robot) << "---\n" << Words(twin));
  CHECK_THAT(Words(robot), Catch::Contains("the simulator's steps are too long") &&
                               Catch::Contains("integrator = \"leapfrog\""));
  CHECK_THAT(Words(twin), !Catch::Contains("too long"));
}

TEST_CASE("rounding is left only where hardly an error is more than that") {
  const Eigen::VectorXd units = Eigen::Vector2d(1, 8);
  std::vector<WindowErrors::Row> rows;
  for (int i = 0; i < 1000; ++i) rows.push_back({i / 2, 0, i / 2, i % 2});
  Eigen::VectorXd errors = Eigen::VectorXd::LinSpaced(1000, -3, 3);
  CHECK(LeavesRounding(1e-6 * units, units, rows, errors));
  CHECK_FALSE(LeavesRounding(1e-4 * units, units, rows, errors));
  errors.head(9).setConstant(1e4);
  CHECK(LeavesRounding(1e-6 * units, units, rows, errors));
  errors.head(300).setConstant(1e4);
  CHECK_FALSE(LeavesRounding(1e-6 * units, units, rows, errors));
  // Rounding has no scale of its own.
  errors.head(300).setConstant(40);
  CHECK(LeavesRounding(1e-6 * units, units, rows, errors));
}

TEST_CASE("a residual that is left out takes its words with it") {
  Gap gap;
  gap.informed = Informed::kNone;
  gap.residual = std::make_shared<Residual>();
  gap.free.transitions = 7;
  gap.unexplained = "the model does not explain the motion";
  gap.summary = gap.unexplained + "; of what it lacks, the learnt residual explains much";
  LeaveOut("it predicts worse", &gap);
  CHECK(gap.residual == nullptr);
  CHECK(gap.free.transitions == 0);
  CHECK(gap.summary == "the model does not explain the motion; it predicts worse");
}

}  // namespace
}  // namespace plumb
