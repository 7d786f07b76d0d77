#include "calibrator/fit/curriculum.h"
#include "calibrator/fit/robot_least_squares.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <stdexcept>

#include "common/decompositions.h"
#include "sim/windows.h"
#include "tests/calibrator/hopper.h"
#include "tests/calibrator/synthetic.h"

namespace plumb {
namespace {

constexpr double kNoise = 1e-5;  // variance of each entry of s'

// The Cramer-Rao bound on masses of windows with exact beginnings: sd of each, from central
// differences of what plain windows predict and the noise as it was made.
Eigen::VectorXd Bound(const std::shared_ptr<const Model>& model,
                      const std::vector<Rollout>& rollouts, const Eigen::VectorXd& masses,
                      size_t horizon) {
  std::vector<Window> windows;
  for (const Rollout& rollout : rollouts) {
    for (size_t i = 0; i < rollout.transitions.size(); ++i) {
      if (i % horizon == 0)
        windows.push_back({rollout.transitions[i].q, rollout.transitions[i].v, {}});
      windows.back().steps.emplace_back(rollout.transitions[i].efforts);
    }
  }
  const Eigen::Index p = masses.size(), n = model->num_velocities();
  constexpr double kStep = 1e-5;
  Eigen::MatrixXd moved = masses.replicate(1, 2 * p);
  for (Eigen::Index k = 0; k < p; ++k) moved(k, 2 * k) += kStep, moved(k, 2 * k + 1) -= kStep;
  std::vector<Eigen::MatrixXd> ends(
      static_cast<size_t>(2 * p),
      Eigen::MatrixXd(2 * n, static_cast<Eigen::Index>(windows.size() * horizon)));
  for (Eigen::MatrixXd& end : ends) end.setZero();
  Windows simulate(model, 1);
  simulate.Predict(
      moved, windows,
      [&](Eigen::Index sample, size_t window, size_t step, const auto& q, const auto& v) {
        ends[static_cast<size_t>(sample)].col(static_cast<Eigen::Index>(window * horizon + step))
            << q,
            v;
      },
      false);
  Eigen::MatrixXd slopes(ends[0].size(), p);
  for (Eigen::Index k = 0; k < p; ++k) {
    slopes.col(k) =
        ((ends[static_cast<size_t>(2 * k)] - ends[static_cast<size_t>(2 * k + 1)]) / (2 * kStep))
            .reshaped();
  }
  return Inverse(slopes.transpose() * slopes / kNoise).diagonal().cwiseSqrt();
}

Eigen::VectorXd StartNear(const RobotDescription& robot, uint32_t stream) {
  return RandomMasses(robot, stream).array().log();
}

// Whether 95 % intervals hold the truth, over the four masses.
int Inside(const LaplaceFit& fit, const Eigen::VectorXd& truth) {
  const Eigen::ArrayXd sd = fit.posterior.covariance.diagonal().array().sqrt();
  return static_cast<int>(((fit.mode.array() - truth.array().log()).abs() < 1.96 * sd).count());
}

TEST_CASE("masses of the hopper come out as exactly as the data allow, in so many steps") {
  const RobotDescription robot = Hopper();
  const auto model = std::make_shared<Model>(robot);
  constexpr int kSets = 20;
  double squared = 0, bound = 0, one_step_squared = 0, one_step_bound = 0;
  std::vector<int64_t> steps, one_step_steps;
  for (uint32_t set = 0; set < kSets; ++set) {
    const Eigen::VectorXd truth = RandomMasses(robot, set);
    const std::vector<Rollout> rollouts = RandomRollouts(robot, truth, 1000, kNoise, set);
    const CurriculumFit fit = FitCurriculum(model, rollouts, {});
    squared += (fit.fit.mode.array().exp() - truth.array()).square().sum();
    bound += Bound(model, rollouts, truth, static_cast<size_t>(fit.horizon)).squaredNorm();
    steps.push_back(fit.simulated_steps);
    CurriculumOptions single;
    single.horizons = {1};
    const CurriculumFit one_step = FitCurriculum(model, rollouts, single);
    one_step_squared += (one_step.fit.mode.array().exp() - truth.array()).square().sum();
    one_step_bound += Bound(model, rollouts, truth, 1).squaredNorm();
    one_step_steps.push_back(one_step.simulated_steps);
  }
  std::sort(steps.begin(), steps.end());
  std::sort(one_step_steps.begin(), one_step_steps.end());
  // Root mean squares over sets and masses.
  CAPTURE(std::sqrt(squared / (4 * kSets)), std::sqrt(bound / (4 * kSets)), steps[kSets / 2],
          steps.back());
  CAPTURE(std::sqrt(one_step_squared / (4 * kSets)), std::sqrt(one_step_bound / (4 * kSets)),
          one_step_steps[kSets / 2], one_step_steps.back());
  CHECK(squared < 1.5 * 1.5 * bound);
  CHECK(squared > 0.7 * 0.7 * bound);  // or the bound is none
  CHECK(one_step_squared < 1.5 * 1.5 * one_step_bound);
  CHECK(one_step_squared > 0.7 * 0.7 * one_step_bound);
  CHECK(bound < 0.35 * 0.35 * one_step_bound);
  CHECK(one_step_steps.back() <= 20'000);
  CHECK(steps[kSets / 2] <= 75'000);
}

TEST_CASE("intervals of the hopper's masses hold the truth as often as they say") {
  const RobotDescription robot = Hopper();
  const auto model = std::make_shared<Model>(robot);
  constexpr int kSets = 120;
  int inside = 0, one_step_inside = 0;
  for (uint32_t set = 0; set < kSets; ++set) {
    const Eigen::VectorXd truth = RandomMasses(robot, 1000 + set);
    const std::vector<Rollout> rollouts = RandomRollouts(robot, truth, 200, kNoise, 1000 + set);
    const CurriculumFit fit = FitCurriculum(model, rollouts, {});
    inside += Inside(fit.fit, truth);
    one_step_inside += Inside(fit.one_step, truth);
  }
  // Over that many sets, 95 % has a standard deviation of 1 %.
  CHECK(inside / (4.0 * kSets) == Approx(0.95).margin(0.03));
  CHECK(one_step_inside / (4.0 * kSets) == Approx(0.95).margin(0.03));
}

TEST_CASE("without noise, a hundred transitions give the masses to all digits, in few steps") {
  const RobotDescription robot = Hopper();
  const auto model = std::make_shared<Model>(robot);
  for (uint32_t set = 0; set < 5; ++set) {
    const Eigen::VectorXd truth = RandomMasses(robot, 100 + set);
    const std::vector<Rollout> rollouts = RandomRollouts(robot, truth, 100, 0, 100 + set);
    const CurriculumFit fit = FitCurriculum(model, rollouts, {});
    CAPTURE(set, fit.simulated_steps, fit.horizon);
    CHECK((fit.fit.mode.array().exp() - truth.array()).abs().maxCoeff() < 1e-8);
    CHECK(fit.simulated_steps <= 2500);
  }
}

// One long episode: whoever falls lies on the ground and goes on.
std::vector<Rollout> Onwards(const RobotDescription& robot, const Eigen::VectorXd& truth, int steps,
                             uint32_t stream, double amplitude) {
  Environment environment(robot);
  environment.SetParameters(truth);
  Random random(47, {stream});
  environment.Reset(random);
  Rollout rollout;
  const Eigen::Index n = robot.num_velocities();
  for (int step = 0; step < steps; ++step) {
    Transition t;
    t.step = step;
    t.q = environment.q(), t.v = environment.v();
    Eigen::VectorXf action(environment.action_size());
    for (float& a : action) a = static_cast<float>(random.Uniform(-amplitude, amplitude));
    environment.Step(action);
    t.efforts = {{robot.task.period, environment.effort()}};
    t.next_q = environment.q(), t.next_v = environment.v();
    for (double& x : t.next_q) x += std::sqrt(kNoise) * random.Normal();
    for (double& x : t.next_v) x += std::sqrt(kNoise) * random.Normal();
    t.q_sd = t.v_sd = Eigen::VectorXd::Zero(n);
    t.next_q_sd = t.next_v_sd =
        Eigen::VectorXd::Constant(n, std::numeric_limits<double>::quiet_NaN());
    rollout.transitions.push_back(t);
  }
  return {rollout};
}

// Root mean square of the errors in units of their own standard deviations.
double Off(const LaplaceFit& fit, const Eigen::VectorXd& truth) {
  return std::sqrt(((fit.mode.array() - truth.array().log()) /
                    fit.posterior.covariance.diagonal().array().sqrt())
                       .square()
                       .mean());
}

TEST_CASE("from one step to fifty, the masses are found wherever the search begins") {
  const RobotDescription robot = Hopper();
  const auto model = std::make_shared<Model>(robot);
  const Eigen::VectorXd truth = RandomMasses(robot, 7);
  // 40 windows of 50 steps
  const std::vector<Rollout> rollouts = Onwards(robot, truth, 2000, 7, 1);
  CurriculumOptions options;
  options.starts = 1;
  constexpr int kStarts = 10;
  int good = 0, long_windows = 0;
  for (uint32_t i = 0; i < kStarts; ++i) {
    const CurriculumFit fit = FitCurriculum(model, rollouts, options, StartNear(robot, 200 + i));
    good += Off(fit.fit, truth) < 1.5;
    long_windows += fit.horizon == 50;
    // And it is not modest about it.
    if (i > 0) continue;
    const Eigen::ArrayXd bound =
        Bound(model, rollouts, truth, static_cast<size_t>(fit.horizon)).array() / truth.array();
    CHECK(
        ((fit.fit.posterior.covariance.diagonal().array().sqrt() / bound).log().abs() < 0.2).all());
  }
  CHECK(good == kStarts);
  CHECK(long_windows == kStarts);
}

TEST_CASE("long windows at once lead astray, and step by step they do not") {
  const RobotDescription robot = Hopper();
  const auto model = std::make_shared<Model>(robot);
  const Eigen::VectorXd truth = RandomMasses(robot, 7);
  const std::vector<Rollout> rollouts = Onwards(robot, truth, 1000, 7, 1);
  CurriculumOptions options;
  options.starts = 1;
  options.horizons = {1, 5, 10, 50, 200};
  int direct = 0, by_steps = 0;
  const auto error = [&](const LaplaceFit& fit) {
    return (fit.mode.array().exp() - truth.array()).abs().maxCoeff();
  };
  for (uint32_t i = 0; i < 4; ++i) {
    const Eigen::VectorXd start = StartNear(robot, 200 + i);
    WindowErrors errors(model, rollouts, 200, 1);
    try {
      direct += error(FitLaplace(ProblemOf(robot, errors), start)) < 0.01;
    } catch (const std::invalid_argument&) {  // the start itself cannot be simulated for so long
    }
    by_steps += error(FitCurriculum(model, rollouts, options, start).fit) < 0.01;
  }
  CHECK(direct <= 1);
  CHECK(by_steps == 4);
}

TEST_CASE("a curriculum has the same bits with any number of threads") {
  const RobotDescription robot = Hopper();
  const auto model = std::make_shared<Model>(robot);
  const std::vector<Rollout> rollouts =
      RandomRollouts(robot, RandomMasses(robot, 8), 200, kNoise, 8);
  CurriculumOptions options;
  const CurriculumFit one = FitCurriculum(model, rollouts, options);
  options.execution = 2;
  const CurriculumFit two = FitCurriculum(model, rollouts, options);
  CHECK(one.fit.mode == two.fit.mode);
  CHECK(one.fit.posterior.covariance == two.fit.posterior.covariance);
  CHECK(one.one_step.errors == two.one_step.errors);
  CHECK(one.simulated_steps == two.simulated_steps);
  CHECK(one.horizon == two.horizon);
}

TEST_CASE("stages say what they did") {
  const RobotDescription robot = Hopper();
  const auto model = std::make_shared<Model>(robot);
  const Eigen::VectorXd truth = RandomMasses(robot, 9);
  const std::vector<Rollout> rollouts = Onwards(robot, truth, 400, 9, 0.5);
  std::vector<double> shares;
  CurriculumOptions options;
  options.horizons = {1, 5};
  options.progress = [&](const std::string&, double share) { shares.push_back(share); };
  const CurriculumFit fit = FitCurriculum(model, rollouts, options);
  REQUIRE(fit.stages.size() == 2);
  CHECK(fit.horizon == 5);
  CHECK(fit.stages[0].windows == 400);
  CHECK(fit.stages[1].windows == 80);
  CHECK(fit.stages[1].sd.maxCoeff() < fit.stages[0].sd.maxCoeff());
  CHECK(fit.stages[1].mean == fit.fit.mode);
  CHECK(fit.stages[0].mean == fit.one_step.mode);
  for (const CurriculumStage& stage : fit.stages)
    CHECK(stage.discrepancy == Approx(1).epsilon(0.1));
  CHECK((fit.noise_sd.array() / std::sqrt(kNoise) - 1).abs().maxCoeff() < 0.2);
  CHECK(fit.failures == 0);
  CHECK(std::is_sorted(shares.begin(), shares.end()));
  CHECK(shares.back() == Approx(1));
  // One-step errors at the final mode, by their own noise.
  WindowErrors errors(model, rollouts, 1, 1);
  const Eigen::VectorXd raw = errors.Raw(robot.ToPhysical(fit.fit.mode));
  CHECK((fit.one_step.errors.array() * fit.noise_sd.replicate(400, 1).array() - raw.array())
            .abs()
            .maxCoeff() < 1e-12);
}

// Their squares overflow: no mode explains them, and there is no noise to go on with.
TEST_CASE("errors beyond all numbers are refused") {
  const RobotDescription robot = Pendulum();
  Eigen::VectorXd truth(robot.parameters.size());
  for (size_t i = 0; i < robot.parameters.size(); ++i)
    truth(static_cast<Eigen::Index>(i)) = robot.parameters[i].mean;
  for (const bool surely : {false, true}) {
    Rollout rollout = SyntheticRollout(robot, truth, 60, 1e-3, 1e-2, 1);
    for (Transition& t : rollout.transitions) {
      if (surely) {
        for (auto* sd : {&t.q_sd, &t.v_sd, &t.next_q_sd, &t.next_v_sd}) sd->setConstant(1e-160);
      } else {
        t.next_q.setConstant(1e160), t.next_v.setConstant(1e160);
      }
    }
    CHECK_THROWS_AS(FitCurriculum(std::make_shared<Model>(robot), std::span(&rollout, 1), {}),
                    std::invalid_argument);
  }
}

}  // namespace
}  // namespace plumb
