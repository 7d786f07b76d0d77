#include "experiments/random_forces.h"

#include "common/decompositions.h"
#include "robot/parameter_distribution.h"
#include "sim/residual_inputs.h"
#include "sim/simulator.h"

namespace plumb {
namespace {

constexpr uint32_t kStream = 0x4572'6669;  // of random numbers; "Erfi"
constexpr int kDraws = 32;

}  // namespace

std::shared_ptr<const Residual> RandomForces(const RobotDescription& robot, double share,
                                             uint64_t seed) {
  const Eigen::Index d = ResidualInputCount(robot), n = robot.num_velocities();
  // The velocities that a torque for one step gives, in the state of rest.
  Simulator simulator(robot);
  const Eigen::MatrixXd inverse = Inverse(simulator.MassMatrix());
  Eigen::MatrixXd push = Eigen::MatrixXd::Zero(n, n);
  const std::vector<int> driven = robot.driven();
  const Eigen::VectorXd limits = robot.effort_limits();
  for (size_t a = 0; a < driven.size(); ++a) {
    push.col(driven[a]) =
        robot.task.period * share * limits[static_cast<Eigen::Index>(a)] * inverse.col(driven[a]);
  }
  // as if its acceleration were constant
  Eigen::MatrixXd effect = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  effect.topLeftCorner(n, n) = robot.task.period / 2 * push;
  effect.bottomLeftCorner(n, n) = push;
  ResidualFunction f;
  f.mean = Eigen::VectorXd::Zero(d), f.scale = Eigen::VectorXd::Ones(d);
  f.low = f.high = Eigen::VectorXd::Zero(d);
  f.centres = Eigen::MatrixXd::Zero(1, d);
  f.noise = effect;
  f.bound = Eigen::VectorXd::Constant(2 * n, 1e3);
  f.unknown = Eigen::VectorXd::Zero(2 * n);
  auto residual = std::make_shared<Residual>();
  Random random(seed, {kStream});
  const ParameterDistribution prior = ParameterDistribution::Prior(robot);
  for (int k = 0; k < kDraws; ++k) {
    Eigen::VectorXd normal(n);
    for (double& x : normal) x = random.Normal();
    Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(2 * n, f.features());
    weights.col(0) = effect.leftCols(n) * normal;
    f.weights.push_back(weights);
    residual->coordinates.push_back(prior.SampleCoordinates(random));
  }
  residual->free = f, residual->touching = f;
  return residual;
}

}  // namespace plumb
