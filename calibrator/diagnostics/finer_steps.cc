#include "calibrator/diagnostics/finer_steps.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "calibrator/diagnostics/projected_errors.h"
#include "calibrator/fit/robot_least_squares.h"
#include "calibrator/fit/window_errors.h"
#include "calibrator/inference/slopes.h"
#include "common/median.h"
#include "robot/parameter_distribution.h"

namespace plumb {
namespace {

constexpr double kMovedTooFar = 1;        // [posterior sd]
constexpr double kExplainsTooMuch = 0.2;  // of the errors' squares

// 1 / scale of the errors of each row's coordinate, 0 of outliers.
Eigen::VectorXd Weights(std::span<const WindowErrors::Row> rows, const Eigen::VectorXd& errors,
                        Eigen::Index coordinates) {
  std::vector<std::vector<double>> sizes(static_cast<size_t>(coordinates));
  for (size_t i = 0; i < rows.size(); ++i)
    sizes[static_cast<size_t>(rows[i].coordinate)].push_back(
        std::abs(errors(static_cast<Eigen::Index>(i))));
  std::vector<double> scale;
  scale.reserve(sizes.size());
  for (std::vector<double>& own : sizes)
    scale.push_back(own.empty() ? 1 : kSdOverMedianDeviation * Median(std::move(own)));
  Eigen::VectorXd weights(errors.size());
  for (size_t i = 0; i < rows.size(); ++i) {
    const double s = scale[static_cast<size_t>(rows[i].coordinate)];
    const auto at = static_cast<Eigen::Index>(i);
    weights(at) = s > 0 && std::abs(errors(at)) <= kOutlier * s ? 1 / s : 0;
  }
  return weights;
}

}  // namespace

std::optional<FinerSteps> TryFinerSteps(const std::shared_ptr<const Model>& model,
                                        std::span<const Rollout> rollouts, int horizon,
                                        const Eigen::VectorXd& noise_sd,
                                        const Eigen::VectorXd& mean, ExecutionOptions execution,
                                        int64_t* simulated_steps) {
  const RobotDescription& robot = model->description();
  RobotDescription halved = robot;
  halved.simulation.substep /= 2;
  WindowErrors coarse(model, rollouts, horizon, execution),
      fine(std::make_shared<const Model>(halved), rollouts, horizon, execution);
  const Eigen::VectorXd physical = robot.ToPhysical(mean);
  for (WindowErrors* errors : {&coarse, &fine}) {
    errors->set_noise_sd(noise_sd);
    errors->Linearise(physical);
  }
  const Eigen::VectorXd coarser = coarse.Whitened(physical), finer = fine.Whitened(physical);
  *simulated_steps += coarse.simulated_steps() + 2 * fine.simulated_steps();
  if (!coarser.allFinite() || !finer.allFinite()) return std::nullopt;

  const Eigen::VectorXd weights = Weights(coarse.rows(), coarser, noise_sd.size());
  const Eigen::VectorXd before = weights.cwiseProduct(coarser), after = weights.cwiseProduct(finer);
  const int64_t so_far = coarse.simulated_steps();
  const LeastSquares problem = ProblemOf(robot, coarse);
  const Eigen::MatrixXd jacobian = Slopes(
      [&](const Eigen::MatrixXd& u) -> Eigen::MatrixXd {
        return weights.asDiagonal() * problem.errors(problem.prior.FromStandard(u));
      },
      problem.prior.ToStandard(mean), before, problem.block);
  *simulated_steps += coarse.simulated_steps() - so_far;
  Eigen::MatrixXd precision = jacobian.transpose() * jacobian;
  precision.diagonal().array() += 1;
  FinerSteps result;
  result.displacement = -precision.llt().solve(jacobian.transpose() * (after - before));
  result.before = before.squaredNorm();
  result.after = (after + jacobian * result.displacement).squaredNorm();
  return result;
}

std::string WhyTooLong(const FinerSteps& finer, const RobotDescription& robot,
                       const Gaussian& posterior) {
  if (!finer.credible()) return {};
  const Eigen::VectorXd moves = finer.displacement.array() *
                                PriorGaussian(robot).covariance.diagonal().array().sqrt() /
                                posterior.covariance.diagonal().array().sqrt();
  Eigen::Index most = 0;
  const double largest = moves.cwiseAbs().maxCoeff(&most);
  std::string what;
  if (largest > kMovedTooFar)
    what = fmt::format("would move {} by {:.2g} of its standard deviations",
                       robot.parameters[static_cast<size_t>(most)].name, largest);
  if (finer.explained() > kExplainsTooMuch)
    what += fmt::format("{}would explain {:.0f} % of the errors' squares",
                        what.empty() ? "" : ", and ", 100 * finer.explained());
  if (what.empty()) return {};
  const bool leaps = robot.simulation.integrator == SimulationSettings::Integrator::kLeapfrog;
  return fmt::format(
      "the simulator's steps are too long for this log: half the substep of {:g} s {}; give "
      "[simulation] a shorter one{}",
      robot.simulation.substep, what, leaps ? "" : ", or integrator = \"leapfrog\"");
}

}  // namespace plumb
