#include "calibrator/gap/gap.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "calibrator/diagnostics/model_test.h"
#include "calibrator/fit/methods.h"
#include "robot/parameter_distribution.h"
#include "sim/correction.h"
#include "sim/parameters.h"
#include "sim/touch.h"
#include "tests/calibrator/fitted_log.h"
#include "tests/calibrator/hopper.h"

namespace plumb {
namespace {

// What the method says by itself, and what becomes of it.
struct Closed {
  MethodResult alone;
  GapFit fit;
};
CalibrationOptions Options(bool residual = true) {
  CalibrationOptions options;
  options.method = "laplace", options.horizons = {1}, options.residual = residual;
  return options;
}
Closed Close(const RobotDescription& robot, const std::vector<Rollout>& rollouts,
             bool residual = true) {
  const CalibrationOptions options = Options(residual);
  const MethodInput input{std::make_shared<Model>(robot), rollouts, options};
  MethodResult alone = RunMethod(input);
  GapFit fit = CloseGap(input, alone);
  return {std::move(alone), std::move(fit)};
}

// The method's posterior, as wide as what may be wrong makes it.
Gaussian Considered(const RobotDescription& robot, const std::vector<Rollout>& rollouts) {
  const CalibrationOptions options = Options();
  const MethodInput input{std::make_shared<Model>(robot), rollouts, options};
  const MethodResult result = RunMethod(input);
  int64_t steps = 0;
  return Moments(TestModel(input, result, ViewOneStep(input, result), &steps).considered);
}

// Mean squared errors of the velocities of a log's steps of a condition, without and with the
// residual's first draw.
struct Squares {
  double before = 0, after = 0;
};
Squares SquaredErrors(const RobotDescription& robot, const Residual& learnt, bool touching,
                      const std::vector<Rollout>& rollouts) {
  auto residual = std::make_shared<Residual>(learnt);
  for (const Residual::Part& part : Residual::kParts) {
    auto& function = residual.get()->*part.function;
    if (function) function->noise.setZero(), function->unknown.setZero();
  }
  const Model model(robot);
  Simulator simulator(robot);
  simulator.SetParameters(robot.ToPhysical(residual->coordinates[0]));
  Correction correction(model, residual);
  Random random(1);
  correction.Begin(0, random);
  Squares squares;
  for (const Rollout& rollout : rollouts) {
    for (size_t i = 1; i < rollout.transitions.size(); ++i) {
      const Transition& t = rollout.transitions[i];
      simulator.SetState(t.q, t.v);
      correction.BeginStep(simulator);
      simulator.Step(t.efforts);
      const double before = (t.next_v - simulator.v()).squaredNorm();
      correction.EndStep(simulator, t.efforts[0].effort,
                         rollout.transitions[i - 1].efforts[0].effort, t.duration());
      if (correction.touching() != touching) continue;
      squares.before += before;
      squares.after += (t.next_v - simulator.v()).squaredNorm();
    }
  }
  return squares;
}

}  // namespace

TEST_CASE("a right model keeps its posterior to the bit, and lacks nothing") {
  const RobotDescription robot = Hopper();
  const auto log = RandomLog(robot, {}, 400, 3);
  const auto [alone, gap] = Close(robot, log);
  CHECK_FALSE(gap.alarm.alarm);
  CHECK(gap.explained);
  CHECK_FALSE(gap.gap.residual);
  CHECK(gap.gap.summary.empty());
  CHECK(gap.gap.informed == Informed::kAll);
  CHECK(gap.result.posterior == alone.posterior);
  CHECK(gap.result.samples == alone.samples);
}

TEST_CASE("a softer ground: masses are learnt from what it cannot do, and the ground apart") {
  const RobotDescription robot = Hopper();
  const Truth softer{{{"contact/stiffness", 0.3 * robot.simulation.contact->stiffness}}};
  std::vector<Rollout> log = RandomLog(robot, softer, 4000, 3), unseen;
  while (CountTransitions(log) > 3000) unseen.push_back(log.back()), log.pop_back();
  const GapFit gap = Close(robot, log).fit;
  REQUIRE(gap.alarm.alarm);
  CHECK(gap.gap.informed == Informed::kBesideContacts);
  CHECK(gap.gap.summary.find("from what contacts cannot have done") != std::string::npos);
  REQUIRE(gap.gap.residual);
  CHECK_FALSE(gap.gap.residual->free);
  REQUIRE(gap.gap.residual->touching);
  CHECK(Explained(gap.gap.touching).mean() > kLeastExplained);
  CHECK(Explained(gap.gap.free).size() == 0);
  const Eigen::VectorXd truth = HiddenParameters(robot, 3);
  const Gaussian posterior = Moments(gap.result.posterior);
  for (Eigen::Index i = 0; i < posterior.mean.size(); ++i) {
    const ParameterDescription& p = robot.parameters[static_cast<size_t>(i)];
    const double sd = std::sqrt(posterior.covariance(i, i));
    CAPTURE(p.name, p.ToPhysical(posterior.mean(i)), sd);
    CHECK(std::abs(posterior.mean(i) - p.ToCoordinate(truth(i))) < 4 * sd);
    CHECK(sd < 0.05);
  }
  // on motion that was not learnt from
  const Squares squares = SquaredErrors(robot, *gap.gap.residual, true, unseen);
  CHECK(squares.after < 0.3 * squares.before);
}

TEST_CASE("free steps whose own error is too little to matter inform the parameters") {
  const RobotDescription robot = Hopper();
  const Truth wrong{
      {{"contact/stiffness", 0.3 * robot.simulation.contact->stiffness}, {"inertia/leg", 1.03}},
      3e-4,
      3e-4};
  const std::vector<Rollout> log = RandomLog(robot, wrong, 3000, 3);
  const GapFit gap = Close(robot, log).fit;
  REQUIRE(gap.alarm.alarm);
  REQUIRE(Close(robot, FreeSteps(robot, log)).fit.alarm.alarm);
  CHECK(gap.gap.informed == Informed::kBesideContacts);
  const Eigen::VectorXd truth = HiddenParameters(robot, 3);
  const Gaussian posterior = Moments(gap.result.posterior);
  for (Eigen::Index i = 0; i < truth.size(); ++i) {
    const ParameterDescription& p = robot.parameters[static_cast<size_t>(i)];
    const double sd = std::sqrt(posterior.covariance(i, i));
    CAPTURE(p.name, p.ToPhysical(posterior.mean(i)), sd);
    CHECK(std::abs(posterior.mean(i) - p.ToCoordinate(truth(i))) < 3 * sd);
  }
}

TEST_CASE("touching steps with what no contact can do leave free motion alone to inform") {
  const RobotDescription robot = Hopper();
  std::vector<Rollout> log = RandomLog(robot, {{}, 3e-4, 3e-4}, 2000, 3);
  TouchFinder touch(robot, Residual::kTouchMargin);
  for (Rollout& rollout : log) {
    for (Transition& t : rollout.transitions) {
      if (!touch.Find(t.q).any() && !touch.Find(t.next_q).any()) continue;
      t.next_v += 0.1 * t.v;  // of all joints
    }
  }
  const GapFit gap = Close(robot, log).fit;
  REQUIRE(gap.alarm.alarm);
  CHECK(gap.gap.informed == Informed::kFree);
  const Gaussian in_the_air = Considered(robot, FreeSteps(robot, log));
  CHECK(gap.result.posterior == GaussianMixture{{1}, {in_the_air}});
}

TEST_CASE("friction in free motion: the prior stays, and the residual goes with each draw of it") {
  const RobotDescription robot = Robot("pendulum/gym.toml");
  const auto log = RandomLog(robot, {{{"friction/pivot", 0.5}}, 0, 1e-3}, 600, 3);
  const GapFit gap = Close(robot, log).fit;
  REQUIRE(gap.alarm.alarm);
  CHECK(gap.gap.informed == Informed::kNone);
  CHECK(gap.information.isZero());
  CHECK(gap.result.used == "prior");
  REQUIRE(gap.gap.residual);
  REQUIRE(gap.gap.residual->free);
  CHECK_FALSE(gap.gap.residual->touching);
  CHECK(gap.gap.residual->coordinates.size() == static_cast<size_t>(kResidualDraws));
  CHECK(gap.gap.residual->coordinates[1] != gap.gap.residual->coordinates[2]);
  CHECK(gap.gap.residual->free->weights[1] != gap.gap.residual->free->weights[2]);
  CHECK(gap.gap.summary.find("nothing informs its parameters") != std::string::npos);
}

TEST_CASE("a residual's draws of the prior are robots, where the prior reaches beyond them, too") {
  RobotDescription robot = Robot("pendulum/gym.toml");
  robot.parameters.push_back(
      {"damping/pivot", "Nm s/rad", ParameterDescription::Coordinate::kLinear, 0.02, 0.0004});
  const auto log = RandomLog(robot, {{{"friction/pivot", 0.5}}, 0, 1e-3}, 600, 3);
  const GapFit gap = Close(robot, log).fit;
  REQUIRE(gap.gap.informed == Informed::kNone);
  REQUIRE(gap.gap.residual);
  for (const Eigen::VectorXd& coordinates : gap.gap.residual->coordinates)
    CHECK(robot.ToPhysical(coordinates)(robot.FindParameter("damping/pivot")) >= 0);
}

TEST_CASE(
    "where no residual is worth it, parameters are as unsure as what is wrong may make them") {
  const RobotDescription robot = Robot("double_pendulum");
  const auto log = RandomLog(robot, {{{"gravity", 1.01 * 9.81}}, 3e-4, 3e-4}, 1000, 3);
  const auto [alone, fit] = Close(robot, log);
  REQUIRE(fit.alarm.alarm);
  CHECK(fit.gap.informed == Informed::kAll);
  CHECK_FALSE(fit.gap.residual);
  CHECK(fit.gap.summary.find("as unsure as what may be wrong") != std::string::npos);
  const Eigen::VectorXd truth = HiddenParameters(robot, 3);
  const Gaussian narrow = Moments(alone.posterior), wide = Moments(fit.result.posterior);
  const Eigen::ArrayXd prior = PriorGaussian(robot).covariance.diagonal();
  CHECK((wide.covariance.diagonal().array() < prior).all());
  double farthest = 0;  // of the truth, in standard deviations of the posterior alone
  // squared, in those of the prior
  double before = 0, now = 0;
  for (Eigen::Index i = 0; i < truth.size(); ++i) {
    const ParameterDescription& p = robot.parameters[static_cast<size_t>(i)];
    const double at = p.ToCoordinate(truth(i)), off = std::abs(wide.mean(i) - at),
                 was = std::abs(narrow.mean(i) - at);
    CAPTURE(p.name, off, was, std::sqrt(wide.covariance(i, i)));
    CHECK(off < 2.5 * std::sqrt(wide.covariance(i, i)));
    CHECK(was < 2.5 * std::sqrt(wide.covariance(i, i)));
    CHECK(wide.covariance(i, i) >= narrow.covariance(i, i));
    farthest = std::max(farthest, was / std::sqrt(narrow.covariance(i, i)));
    before += was * was / prior(i), now += off * off / prior(i);
  }
  CHECK(farthest > 10);
  CHECK(now < before);
  CHECK(std::sqrt(wide.covariance(0, 0)) < 0.05);  // a prior's is 0.3: the mass is still known
  const Eigen::VectorXd spread =
      (fit.result.samples.colwise() - wide.mean).rowwise().squaredNorm() /
      fit.result.samples.cols();
  for (Eigen::Index i = 0; i < spread.size(); ++i)
    CHECK(spread(i) == Approx(wide.covariance(i, i)).epsilon(0.2));
}

TEST_CASE("where residuals are switched off an alarm changes nothing, and it is said") {
  const RobotDescription robot = Robot("pendulum/gym.toml");
  const auto log = RandomLog(robot, {{{"friction/pivot", 0.5}}, 0, 1e-3}, 300, 3);
  const auto [alone, fit] = Close(robot, log, false);
  CHECK(fit.alarm.alarm);
  CHECK_FALSE(fit.explained);
  CHECK_FALSE(fit.gap.residual);
  CHECK(fit.result.posterior == alone.posterior);
  CHECK(fit.gap.summary == "what the model lacks is not learnt: residuals are switched off");
}

TEST_CASE("of differences for velocities the posterior is as wide as what may be wrong makes it") {
  const RobotDescription robot = Robot("double_pendulum/robot.toml");
  std::vector<Rollout> log = RandomLog(robot, {}, 300, 3);
  for (Rollout& rollout : log) {
    for (size_t i = rollout.transitions.size(); i-- > 0;) {
      Transition& t = rollout.transitions[i];
      t.next_v = (t.next_q - t.q) / t.duration();
      if (i > 0) t.v = (t.q - rollout.transitions[i - 1].q) / rollout.transitions[i - 1].duration();
    }
  }
  CalibrationOptions options;
  options.method = "laplace", options.horizons = {1};
  const MethodInput input{std::make_shared<Model>(robot), log, options};
  const MethodResult alone = RunMethod(input);
  const GapFit fit = CloseGap(input, alone, "why");
  CHECK_FALSE(fit.alarm.alarm);
  CHECK_FALSE(fit.alarm.judged);
  CHECK_FALSE(fit.explained);
  CHECK(fit.alarm.summary == "why");
  CHECK_FALSE(fit.gap.residual);
  // Off by so many standard deviations at most; the truth is the prior's mean.
  const auto off = [&](const Gaussian& posterior) {
    return ((posterior.mean - PriorGaussian(robot).mean).array() /
            posterior.covariance.diagonal().array().sqrt())
        .abs()
        .maxCoeff();
  };
  CHECK(off(Moments(alone.posterior)) > 10);
  CHECK(off(Moments(fit.result.posterior)) < 2.5);
}

TEST_CASE("several modes stay several where nobody can tell whether the model is right") {
  const RobotDescription robot = Hopper();
  const auto log = RandomLog(robot, {}, 400, 3);
  const CalibrationOptions options = Options();
  const MethodInput input{std::make_shared<Model>(robot), log, options};
  MethodResult both = RunMethod(input);
  const Gaussian mode = Moments(both.posterior);
  Gaussian other = mode;
  other.mean(0) += 20 * std::sqrt(mode.covariance(0, 0));
  both.posterior = {{0.25, 0.75}, {mode, other}};
  const MethodResult kept = CloseGap(input, both, "nobody has read the velocities").result;
  CHECK(kept.posterior.weights == both.posterior.weights);
  REQUIRE(kept.posterior.components.size() == 2);
  for (size_t k : {0, 1}) {
    const Gaussian &before = both.posterior.components[k], &now = kept.posterior.components[k];
    CHECK(now.covariance(0, 0) >= before.covariance(0, 0) * (1 - 1e-9));
  }
  const Eigen::ArrayXd drawn = kept.samples.row(0).transpose();
  const double between = (mode.mean(0) + other.mean(0)) / 2;
  CHECK((drawn > between).cast<double>().mean() == Approx(0.75).margin(0.1));
}

TEST_CASE("of too few steps nothing is learnt, and there is nothing that it explains") {
  const RobotDescription robot = Hopper();
  const std::vector<Rollout> log = RandomLog(robot, {}, kFewestForResidual - 1, 3);
  const auto model = std::make_shared<Model>(robot);
  const ResidualFit fit = FitResidual(model, PriorGaussian(robot).mean, log, {});
  CHECK_FALSE(fit.residual.any());
  CHECK(fit.free.transitions + fit.touching.transitions == kFewestForResidual - 1);
  CHECK(Explained(fit.free).size() == 0);
  CHECK(Explained(fit.touching).size() == 0);
}

TEST_CASE("what is lacking has the same bits each time") {
  const RobotDescription robot = Robot("pendulum/gym.toml");
  const auto log = RandomLog(robot, {{{"friction/pivot", 0.5}}, 0, 1e-3}, 300, 3);
  const GapFit a = Close(robot, log).fit, b = Close(robot, log).fit;
  REQUIRE(a.gap.residual);
  CHECK(a.gap.residual->free->weights == b.gap.residual->free->weights);
  CHECK(a.gap.residual->free->noise == b.gap.residual->free->noise);
}

}  // namespace plumb
