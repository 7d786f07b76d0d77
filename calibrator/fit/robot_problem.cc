#include "calibrator/fit/robot_problem.h"

#include <cmath>
#include <memory>

#include "calibrator/fit/robot_least_squares.h"
#include "calibrator/inference/distances.h"
#include "common/decompositions.h"
#include "common/special_numbers.h"

namespace plumb {
namespace {

Random NoiseOf(uint64_t seed, int64_t simulation) {
  return Random(
      seed, {0xabc, static_cast<uint32_t>(simulation), static_cast<uint32_t>(simulation >> 32)});
}

// Errors divided by the noise's scale, one column of each simulator.
Eigen::MatrixXd Scaled(const LeastSquares& problem, const Eigen::VectorXd& scale,
                       const Eigen::MatrixXd& parameters) {
  Eigen::MatrixXd errors = problem.errors(parameters);
  for (size_t i = 0; i < problem.group.size(); ++i)
    errors.row(static_cast<Eigen::Index>(i)) /= scale(problem.group[i]);
  return errors;
}

// A block of rows as one column each, zeros where nothing was observed.
Eigen::MatrixXd AsSet(const LeastSquares& problem, Eigen::Index dimension,
                      const Eigen::VectorXd& errors) {
  Eigen::MatrixXd set = Eigen::MatrixXd::Zero(dimension, problem.block.back() + 1);
  for (size_t i = 0; i < problem.block.size(); ++i)
    set(problem.group[i], problem.block[i]) = errors(static_cast<Eigen::Index>(i));
  return set;
}

// The errors' projection on what the parameters do to them, as the likelihood weighs them.
Problem ByLikelihood(const std::shared_ptr<const LeastSquares>& problem, const LaplaceFit& first,
                     uint64_t seed) {
  const Eigen::Index n = problem->prior.size();
  const Eigen::VectorXd scale = first.scale;
  const Eigen::MatrixXd slopes = first.jacobian;
  const Eigen::VectorXd sd = problem->prior.Width();
  Eigen::MatrixXd spread = slopes.transpose() * slopes;
  spread.diagonal() += sd.array().square().inverse().matrix();
  const Eigen::MatrixXd project = spread.llt().matrixL().solve(slopes.transpose());
  return {problem->prior, Eigen::VectorXd::Zero(n),
          [=](const Eigen::MatrixXd& parameters, int64_t index) -> Eigen::MatrixXd {
            Eigen::MatrixXd simulated = Scaled(*problem, scale, parameters);
            for (Eigen::Index j = 0; j < simulated.cols(); ++j) {
              Random random = NoiseOf(seed, index + j);
              for (double& e : simulated.col(j)) e += random.Normal();
            }
            return project * simulated;
          }};
}

// The mean of all errors' squares or absolute values.
Problem ByMean(const std::shared_ptr<const LeastSquares>& problem, const Eigen::VectorXd& scale,
               bool squared) {
  return {problem->prior, Eigen::VectorXd::Zero(1),
          [=](const Eigen::MatrixXd& parameters, int64_t) -> Eigen::MatrixXd {
            const Eigen::MatrixXd simulated = Scaled(*problem, scale, parameters);
            if (squared) return simulated.cwiseAbs2().colwise().mean();
            return simulated.cwiseAbs().colwise().mean();
          }};
}

// The distance of the errors' distribution from that of noise.
Problem ByDistance(const std::shared_ptr<const LeastSquares>& problem, const Eigen::VectorXd& scale,
                   Eigen::Index dimension, const std::string& discrepancy, uint64_t seed) {
  // Errors as they would be if they were noise alone: the same for all simulators.
  Random random = NoiseOf(seed, -1);
  const auto rows = static_cast<Eigen::Index>(problem->group.size());
  const SetDistance distance =
      MakeDistance(discrepancy, AsSet(*problem, dimension, StandardNormals(rows, 1, random)), seed);
  return {problem->prior, Eigen::VectorXd::Zero(1),
          [=](const Eigen::MatrixXd& parameters, int64_t) -> Eigen::MatrixXd {
            const Eigen::MatrixXd simulated = Scaled(*problem, scale, parameters);
            Eigen::MatrixXd distances(1, simulated.cols());
            for (Eigen::Index j = 0; j < simulated.cols(); ++j) {
              const double d = simulated.col(j).allFinite()
                                   ? distance(AsSet(*problem, dimension, simulated.col(j)))
                                   : NAN;
              distances(0, j) = std::isfinite(d) ? d : kNaN;
            }
            return distances;
          }};
}

}  // namespace

const std::vector<std::string>& RobotDiscrepancies() {
  static const std::vector<std::string> names{"likelihood", "squared", "absolute",
                                              "energy",     "mmd",     "sliced-wasserstein"};
  return names;
}

Problem RobotProblem(const RobotDescription& robot, WindowErrors& errors, const LaplaceFit& first,
                     const std::string& discrepancy, uint64_t seed) {
  const auto problem = std::make_shared<const LeastSquares>(ProblemOf(robot, errors));
  if (discrepancy == "likelihood") return ByLikelihood(problem, first, seed);
  if (discrepancy == "squared" || discrepancy == "absolute")
    return ByMean(problem, first.scale, discrepancy == "squared");
  const Eigen::Index dimension = Eigen::Index{2} * errors.num_velocities();
  return ByDistance(problem, first.scale, dimension, discrepancy, seed);
}

}  // namespace plumb
