#include "tests/calibrator/fitted_log.h"

#include <cstdlib>
#include <span>

#include "calibrator/diagnostics/candidates.h"
#include "calibrator/fit/discrepancy.h"
#include "common/decompositions.h"
#include "common/random.h"
#include "sim/environment.h"
#include "sim/model.h"
#include "sim/parameters.h"

namespace plumb {

RobotDescription Robot(const std::string& name) {
  return LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/" + name);
}

std::vector<Rollout> RandomLog(const RobotDescription& fitted, const Truth& truth, int transitions,
                               uint64_t seed) {
  const auto [robot, physical] = Change(fitted, truth.changed, seed);
  Environment environment(robot);
  environment.SetParameters(physical);
  // what is delayed reaches over control steps: one simulator for an episode
  Simulator simulator(robot);
  simulator.SetParameters(physical);
  const Eigen::Index n = simulator.num_velocities();
  Random random(seed, {1});
  const auto noisy = [&](const Eigen::VectorXd& x, double sd) {
    Eigen::VectorXd y = x;
    for (double& entry : y) entry += sd * random.Normal();
    return y;
  };
  std::vector<Rollout> rollouts;
  for (int count = 0; count < transitions;) {
    environment.Reset(random);
    simulator.SetState(environment.q(), environment.v());
    rollouts.emplace_back().episode = static_cast<int64_t>(rollouts.size());
    Eigen::VectorXd q = noisy(simulator.q(), truth.start_sd),
                    v = noisy(simulator.v(), truth.start_sd);
    for (int step = 0; step < robot.task.steps && count < transitions; ++step, ++count) {
      Transition t;
      t.step = step;
      t.q = q, t.v = v;
      Eigen::VectorXf action(environment.action_size());
      for (float& a : action) a = static_cast<float>(random.Uniform(-1, 1));
      Eigen::VectorXd effort(n);
      environment.task().Effort(std::span(action.data(), static_cast<size_t>(action.size())),
                                effort);
      t.efforts.push_back({robot.task.period, effort});
      simulator.Step(t.efforts);
      t.next_q = noisy(simulator.q(), truth.end_sd), t.next_v = noisy(simulator.v(), truth.end_sd);
      t.q_sd = t.v_sd = Eigen::VectorXd::Constant(n, truth.start_sd);
      t.next_q_sd = t.next_v_sd = Eigen::VectorXd::Constant(n, truth.end_sd);
      q = truth.start_sd > 0 ? t.next_q : simulator.q();
      v = truth.start_sd > 0 ? t.next_v : simulator.v();
      rollouts.back().transitions.push_back(std::move(t));
      if (environment.task().Terminated(simulator.q(), simulator.v())) {
        ++count;
        break;
      }
    }
  }
  return rollouts;
}

FittedLog::FittedLog(const RobotDescription& robot, std::vector<Rollout> log)
    : rollouts(std::move(log)) {
  Discrepancy discrepancy(robot);
  Eigen::VectorXd x(robot.parameters.size());
  for (size_t i = 0; i < robot.parameters.size(); ++i)
    x(static_cast<Eigen::Index>(i)) = robot.parameters[i].coordinate_mean();
  Eigen::VectorXd r;
  Eigen::MatrixXd jacobian;
  constexpr int kIterations = 4;
  for (int iteration = 0; iteration <= kIterations; ++iteration) {
    Eigen::MatrixXd physicals(x.size(), 2 * x.size() + 1);
    const double h = 1e-4;
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      physicals.col(2 * k) = robot.ToPhysical(x + h * Eigen::VectorXd::Unit(x.size(), k));
      physicals.col(2 * k + 1) = robot.ToPhysical(x - h * Eigen::VectorXd::Unit(x.size(), k));
    }
    physicals.rightCols(1) = robot.ToPhysical(x);
    const Eigen::MatrixXd errors = discrepancy.Residuals(physicals, rollouts);
    r = errors.rightCols(1);
    jacobian.resize(r.size(), x.size());
    for (Eigen::Index k = 0; k < x.size(); ++k)
      jacobian.col(k) = (errors.col(2 * k) - errors.col(2 * k + 1)) / (2 * h);
    if (iteration == kIterations) break;
    // A prior far weaker than the data would hardly matter.
    x -= Eigen::MatrixXd(jacobian.transpose() * jacobian +
                         Eigen::MatrixXd::Identity(x.size(), x.size()))
             .ldlt()
             .solve(jacobian.transpose() * r);
  }
  physical = robot.ToPhysical(x);
  known = Model(robot).Describe(physical);
  const int n = robot.num_velocities();
  for (size_t i = 0, window = 0; i < rollouts.size(); ++i) {
    for (size_t k = 0; k < rollouts[i].transitions.size(); ++k, ++window) {
      for (int c = 0; c < n;
           ++c) {  // as Discrepancy::Residuals has them: speed, then position, joint by joint
        for (const int coordinate : {n + c, c}) {
          rows.push_back(
              {static_cast<int>(window), static_cast<int>(i), static_cast<int>(k), coordinate});
        }
      }
    }
  }
  residuals.errors = r;
  residuals.jacobian = jacobian;
  residuals.noise_known.assign(static_cast<size_t>(2 * n), true);
  RobotDescription own = known;
  own.parameters = robot.parameters;
  residuals.candidates = FindCandidates(own);
  Discrepancy extended(WithCandidates(robot, residuals.candidates));
  residuals.columns =
      CandidateColumns([&](const Eigen::MatrixXd& p) { return extended.Residuals(p, rollouts); },
                       physical, residuals.candidates);
}

Misspecification FittedLog::Find() {
  residuals.rollouts = rollouts;
  residuals.rows = rows;
  return FindMisspecification(known, residuals);
}

}  // namespace plumb
