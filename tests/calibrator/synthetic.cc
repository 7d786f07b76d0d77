#include "tests/calibrator/synthetic.h"

#include <cmath>
#include <cstdlib>
#include <string>

#include "calibrator/fit/discrepancy.h"
#include "common/decompositions.h"
#include "common/random.h"
#include "robot/parameter_distribution.h"
#include "sim/simulator.h"

namespace plumb {

RobotDescription Pendulum() {
  return LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/pendulum");
}

Rollout SyntheticRollout(const RobotDescription& robot, const Eigen::VectorXd& truth, int steps,
                         double q_sd, double v_sd, uint32_t stream) {
  Simulator simulator(robot);
  simulator.SetParameters(truth);
  Random random(17, {stream});
  const auto noisy = [&](double x, double sd) {
    return Eigen::VectorXd::Constant(1, x + sd * random.Normal());
  };
  simulator.SetState(Eigen::VectorXd::Constant(1, random.Uniform(-3, 3)), Eigen::VectorXd::Zero(1));
  Rollout rollout;
  rollout.episode = stream;
  Eigen::VectorXd q = noisy(simulator.q()(0), q_sd), v = noisy(simulator.v()(0), v_sd);
  for (int i = 0; i < steps; ++i) {
    Transition t;
    t.step = i;
    t.q = q, t.v = v;
    const Eigen::VectorXd effort = Eigen::VectorXd::Constant(1, random.Uniform(-2, 2));
    for (int k = 0; k < 10; ++k) t.efforts.push_back({0.005, effort});
    simulator.Step(t.efforts);
    q = noisy(simulator.q()(0), q_sd), v = noisy(simulator.v()(0), v_sd);
    t.next_q = q, t.next_v = v;
    t.q_sd = t.next_q_sd = Eigen::VectorXd::Constant(1, q_sd);
    t.v_sd = t.next_v_sd = Eigen::VectorXd::Constant(1, v_sd);
    rollout.transitions.push_back(t);
  }
  return rollout;
}

Gaussian LaplacePosterior(const RobotDescription& robot, const std::vector<Rollout>& rollouts,
                          Eigen::VectorXd start) {
  const Gaussian prior = PriorGaussian(robot);
  Discrepancy discrepancy(robot);
  Eigen::VectorXd x = std::move(start);
  Eigen::MatrixXd precision;
  for (int i = 0; i < 8; ++i) {
    const Eigen::VectorXd r = discrepancy.Residuals(x.array().exp(), rollouts);
    Eigen::MatrixXd jacobian(r.size(), x.size());
    for (int k = 0; k < x.size(); ++k) {
      const Eigen::VectorXd y = x + 1e-6 * Eigen::VectorXd::Unit(x.size(), k);
      jacobian.col(k) = (discrepancy.Residuals(y.array().exp(), rollouts) - r) / 1e-6;
    }
    precision = jacobian.transpose() * jacobian + Inverse(prior.covariance);
    x -= precision.ldlt().solve(jacobian.transpose() * r +
                                Inverse(prior.covariance) * (x - prior.mean));
  }
  return {x, Inverse(precision)};
}

}  // namespace plumb
