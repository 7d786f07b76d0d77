#include "calibrator/results/randomisation.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <vector>

#include "calibrator/fit/robot_draws.h"
#include "calibrator/results/json_lines.h"
#include "common/random.h"
#include "robot/physics_fingerprint.h"
#include "robot/posterior_format.h"
#include "sim/model.h"

namespace plumb {
namespace {

constexpr int kForCorrelations = 10000;  // draws: they are right to 0.01

std::vector<double> Entries(const Eigen::VectorXd& x) { return {x.begin(), x.end()}; }

std::vector<std::vector<double>> Rows(const Eigen::MatrixXd& matrix) {
  std::vector<std::vector<double>> rows;
  rows.reserve(static_cast<size_t>(matrix.rows()));
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) rows.push_back(Entries(matrix.row(i)));
  return rows;
}

// Robots, a row for each, physical units.
Eigen::MatrixXd Draws(const ParameterDistribution& distribution, const Model& model, int count,
                      Random random) {
  const Eigen::MatrixXd draws =
      DrawRobots(model, count, [&] { return distribution.SampleCoordinates(random); });
  Eigen::MatrixXd rows(count, draws.rows());
  for (Eigen::Index i = 0; i < rows.rows(); ++i)
    rows.row(i) = distribution.ToPhysical(draws.col(i));
  return rows;
}

Eigen::MatrixXd Covariance(const Eigen::VectorXd& sd, const Eigen::MatrixXd& draws) {
  const Eigen::MatrixXd centred = draws.rowwise() - draws.colwise().mean();
  const Eigen::MatrixXd products = centred.transpose() * centred;
  Eigen::MatrixXd covariance = sd.cwiseAbs2().asDiagonal();
  for (Eigen::Index i = 0; i < sd.size(); ++i) {
    for (Eigen::Index j = 0; j < sd.size(); ++j) {
      const double spread = std::sqrt(products(i, i) * products(j, j));
      if (i != j && spread > 0) covariance(i, j) = sd(i) * sd(j) * products(i, j) / spread;
    }
  }
  return covariance;
}

}  // namespace

std::string RandomisationJson(const ParameterDistribution& distribution,
                              const RobotDescription& robot, const RandomisationOptions& options) {
  if (options.samples < 1) throw std::invalid_argument("at least one sample is needed");
  if (robot.parameters.empty())
    throw std::invalid_argument(robot.name +
                                " has no uncertain parameters: there is nothing to "
                                "randomise");
  if (distribution.parameters.size() != robot.parameters.size())
    throw std::invalid_argument("the distribution is another robot's");
  std::vector<std::string> names, units;
  for (const ParameterDescription& p : robot.parameters)
    names.push_back(p.name), units.push_back(p.unit);
  const Model model(robot);
  const Eigen::VectorXd sd = distribution.Sd();
  const Eigen::MatrixXd covariance =
      Covariance(sd, Draws(distribution, model, kForCorrelations, Random(options.seed, {1})));
  return JsonLines({
      {"format", "plumbline randomisation"},
      {"version", 1},
      {"robot", robot.name},
      {"physics", Hexadecimal(PhysicsFingerprint(robot))},
      {"source", options.source},
      {"residual", distribution.residual != nullptr},
      {"seed", options.seed},
      {"names", names},
      {"units", units},
      {"mean", Entries(distribution.Mean())},
      {"sd", Entries(sd)},
      {"covariance", Rows(covariance)},
      {"samples", Rows(Draws(distribution, model, options.samples, Random(options.seed, {0})))},
  });
}

}  // namespace plumb
