#include "robot/posterior_reader.h"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "common/decompositions.h"
#include "robot/configuration_space.h"
#include "robot/json_field.h"
#include "robot/json_text.h"
#include "robot/physical.h"
#include "robot/physics_fingerprint.h"
#include "robot/posterior_format.h"
#include "robot/residual_json.h"

namespace plumb {
namespace {

using nlohmann::json;
using Field = JsonField;

constexpr std::uintmax_t kMaxBytes = 256 << 20;

std::string ReadText(const std::filesystem::path& file) {
  if (!std::filesystem::is_regular_file(file)) throw std::runtime_error("there is no such file");
  if (std::filesystem::file_size(file) > kMaxBytes)
    throw std::runtime_error("is longer than 256 MB");
  std::ifstream stream(file, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(stream), {});
  if (!stream) throw std::runtime_error("cannot be read");
  return text;
}

json ParsePosterior(const std::string& text) {
  try {
    return ParseJson(text);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(std::string("is no posterior.json: ") + error.what());
  }
}

void RequireRobot(const Field& root, const RobotDescription& robot) {
  root["format"].RequireText(kPosteriorFormat, "is not a posterior");
  const double version = root["version"].Number();
  root["version"].Require(version == kPosteriorVersion || version == kPosteriorBeforeResiduals,
                          fmt::format("is {}, this program reads {} and {}", version,
                                      kPosteriorBeforeResiduals, kPosteriorVersion));
  root["robot"].RequireText(robot.name, "is another robot's");
  const size_t n = robot.parameters.size();
  const std::vector<Field> names = root["names"].Entries(n), units = root["units"].Entries(n),
                           coordinates = root["coordinates"].Entries(n);
  for (size_t i = 0; i < n; ++i) {
    const ParameterDescription& p = robot.parameters[i];
    names[i].RequireText(p.name, "is another robot's");
    units[i].RequireText(p.unit, p.name + " has another unit now");
    coordinates[i]["kind"].RequireText(CoordinateName(p.coordinate),
                                       p.name + " has another coordinate now");
    if (p.coordinate != ParameterDescription::Coordinate::kLogit) continue;
    for (const auto& [key, bound] : {std::pair{"lower", p.lower}, {"upper", p.upper}}) {
      const double found = coordinates[i][key].Number();
      coordinates[i][key].Require(
          found == bound, fmt::format("is {}, {} has the bound {} now", found, p.name, bound));
    }
  }
  root["physics"].RequireText(
      Hexadecimal(PhysicsFingerprint(robot)),
      "the robot's links, joints, frozen parameters or [simulation] have changed since; "
      "calibrate again");
}

Gaussian ReadComponent(const Field& mean, const Field& covariance, size_t n) {
  Gaussian component{mean.Vector(n), covariance.Matrix(n)};
  const Eigen::MatrixXd& c = component.covariance;
  covariance.Require((c - c.transpose()).cwiseAbs().maxCoeff() <=
                         ParameterDistribution::kRounding * c.cwiseAbs().maxCoeff(),
                     "is not symmetric");
  covariance.Require(Eigen::LLT<Eigen::MatrixXd>(c).info() == Eigen::Success,
                     "is not positive definite");
  return component;
}

ParameterDistribution ReadMixture(const Field& mixture, const RobotDescription& robot) {
  const size_t count = mixture["weights"].size(), n = robot.parameters.size();
  mixture.Require(n > 0, fmt::format("robot '{}' has no parameters", robot.name));
  mixture["weights"].Require(count >= 1 && count <= ParameterDistribution::kMaxComponents,
                             fmt::format("has {} entries", count));
  const std::vector<Field> weights = mixture["weights"].Entries(count),
                           means = mixture["means"].Entries(count),
                           covariances = mixture["covariances"].Entries(count);
  ParameterDistribution distribution{1, robot.parameters, {}};
  double total = 0;
  for (size_t i = 0; i < count; ++i) {
    const double weight = weights[i].Number();
    weights[i].Require(weight > 0, "is not positive");
    distribution.mixture.weights.push_back(weight);
    distribution.mixture.components.push_back(ReadComponent(means[i], covariances[i], n));
    total += weight;
  }
  mixture["weights"].Require(std::abs(total - 1) <= ParameterDistribution::kRounding,
                             fmt::format("sum to {}, not to 1", total));
  const auto plausible = [](const Eigen::VectorXd& x) {
    return x.allFinite() && x.cwiseAbs().maxCoeff() <= kGreatestParameter;
  };
  mixture.Require(
      plausible(distribution.Mean()) && plausible(distribution.Sd()),
      fmt::format("is too far, or too wide: its moments are beyond {:g}", kGreatestParameter));
  return distribution;
}

// Of what is lacking in the simulators that the mixture is of.
void ReadGap(const Field& root, const RobotDescription& robot, ParameterDistribution* to) {
  if (root["version"].Number() == kPosteriorBeforeResiduals) return;
  const auto positions = static_cast<size_t>(robot.num_positions()),
             velocities = static_cast<size_t>(robot.num_velocities());
  const Field residual = root["residual"], starts = root["starts"];
  if (!residual.null()) {
    to->residual = ReadResidual(residual, robot.parameters.size(), 2 * velocities);
    for (const Eigen::VectorXd& draw : to->residual->coordinates)
      residual["draws"].Require(to->ToPhysical(draw).allFinite(), "is too wide: it overflows");
  }
  const ConfigurationSpace space(robot);
  for (const Field& start : starts.Entries(starts.size())) {
    to->starts.push_back(start.SingleVector(positions + velocities));
    const std::string fault = space.Fault(to->starts.back().head(robot.num_positions()));
    start.Require(fault.empty(), "q " + fault);
  }
}

}  // namespace

ParameterDistribution ReadPosterior(const std::filesystem::path& file,
                                    const RobotDescription& robot) {
  try {
    const json j = ParsePosterior(ReadText(file));
    const Field root(j, "");
    if (!j.is_object()) throw std::runtime_error("is not a posterior");
    RequireRobot(root, robot);
    ParameterDistribution distribution = ReadMixture(root["mixture"], robot);
    ReadGap(root, robot, &distribution);
    return distribution;
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  }
}

}  // namespace plumb
