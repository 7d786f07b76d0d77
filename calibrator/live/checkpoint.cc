#include "calibrator/live/checkpoint.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "calibrator/live/json_values.h"
#include "calibrator/live/rollout_json.h"
#include "common/atomic_file.h"
#include "common/checked_file.h"
#include "common/message_bytes.h"
#include "robot/json_text.h"
#include "robot/parameter_distribution.h"

namespace plumb {
namespace {

using nlohmann::json;
using plumb::ToJson;  // of vectors and roll-outs, beside those below

// Version 2: without the method used, its warnings and a search's samples; 3: without a residual; 4
// to 6: with another; 7: without a checksum; 8: without the number of roll-outs that are forgotten;
// 9: without information; 10: without whether the robot is explained
constexpr FileKind kKind{"PLUMBCAL", 11, "a calibrator's checkpoint"};

Informed InformedFrom(const std::string& name) {
  for (const Informed informed : kAllInformed) {
    if (name == Name(informed)) return informed;
  }
  throw std::runtime_error(fmt::format("informed: {} is none", name));
}

json ToJson(const Gaussian& p) {
  const Eigen::MatrixXd& c = p.covariance;
  return {{"mean", ToJson(p.mean)},
          {"covariance", std::vector<double>(c.data(), c.data() + c.size())}};
}

Gaussian GaussianFrom(const json& j) {
  Gaussian p;
  p.mean = VectorFrom(j.at("mean"));
  const auto values = j.at("covariance").get<std::vector<double>>();
  const Eigen::Index n = p.mean.size();
  if (static_cast<Eigen::Index>(values.size()) != n * n)
    throw std::runtime_error("covariance has the wrong size");
  p.covariance = Eigen::MatrixXd::Map(values.data(), n, n);
  LogDensity(p, p.mean);  // throws unless it is positive definite
  return p;
}

// @param n parameters.
Eigen::MatrixXd InformationFrom(const json& j, Eigen::Index n) {
  if (j.empty()) return {};
  if (static_cast<Eigen::Index>(j.size()) != n * n)
    throw std::runtime_error("information has the wrong size");
  Eigen::MatrixXd information(n, n);
  for (Eigen::Index i = 0; i < n * n; ++i)
    information.reshaped()(i) = NumberOrNaN(j.at(static_cast<size_t>(i)));
  return information;
}

json ToJson(const GaussianMixture& mixture) {
  json components = json::array();
  for (size_t i = 0; i < mixture.components.size(); ++i) {
    components.push_back(ToJson(mixture.components[i]));
    components.back()["weight"] = mixture.weights[i];
  }
  return components;
}

GaussianMixture MixtureFrom(const json& j) {
  GaussianMixture mixture;
  for (const json& component : j) {
    mixture.components.push_back(GaussianFrom(component));
    mixture.weights.push_back(component.at("weight"));
  }
  const bool good =
      !mixture.weights.empty() && std::all_of(mixture.weights.begin(), mixture.weights.end(),
                                              [](double w) { return w > 0 && w <= 1; });
  if (!good) throw std::runtime_error("the distribution's weights are none");
  return mixture;
}

std::vector<int> WholeNumbers(const json& j) {
  std::vector<int> numbers;
  for (const json& number : j) numbers.push_back(Whole(number));
  return numbers;
}

// The samples alone: the rest follows from the state. JSON writes -infinity, a failure's density,
// as null.
json ToJson(const RepsState& search) {
  const Eigen::MatrixXd& points = search.points;
  return {{"points", std::vector<double>(points.data(), points.data() + points.size())},
          {"densities", ToJson(search.densities)}};
}

void ReadSamples(const json& j, RepsState* search) {
  const json& densities = j.at("densities");
  const auto points = j.at("points").get<std::vector<double>>();
  const Eigen::Index n = search->distribution.mean.size();
  const auto count = static_cast<Eigen::Index>(densities.size());
  if (static_cast<Eigen::Index>(points.size()) != n * count)
    throw std::runtime_error("the search has not as many points as densities");
  search->points = Eigen::MatrixXd::Map(points.data(), n, count);
  search->densities.resize(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const json& density = densities[static_cast<size_t>(i)];
    search->densities(i) =
        density.is_null() ? -std::numeric_limits<double>::infinity() : density.get<double>();
  }
}

json ReadJson(const std::filesystem::path& file) {
  if (!std::filesystem::is_regular_file(file)) throw std::runtime_error("is not a file");
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw std::runtime_error("cannot be opened");
  const std::string bytes(std::istreambuf_iterator<char>(stream), {});
  return ParseJson(CheckedContent(kKind, bytes));
}

void WriteJson(const std::filesystem::path& file, const json& j) {
  WriteAtomically(file, WithChecksum(kKind, j.dump()));
}

constexpr char kStateFile[] = "calibration.checkpoint";

// Of all iterations.
size_t Count(const std::vector<int>& rollouts_per_iteration) {
  return std::accumulate(
      rollouts_per_iteration.begin(), rollouts_per_iteration.end(), size_t{0},
      [](size_t sum, int rollouts) { return sum + static_cast<size_t>(rollouts); });
}

std::string RolloutFile(size_t index) { return fmt::format("rollout_{}.checkpoint", index); }

std::vector<std::string> ParameterNames(const RobotDescription& robot) {
  std::vector<std::string> names;
  for (const ParameterDescription& p : robot.parameters) names.push_back(p.name);
  return names;
}

// @throws std::runtime_error unless a calibration is of this robot, as its files are today.
void RequireRobot(const json& j, const RobotDescription& robot) {
  if (j.at("robot") != robot.name || j.at("parameters") != ParameterNames(robot))
    throw std::runtime_error("is another robot's");
  if (j.at("fingerprint") != robot.fingerprint) {
    throw std::runtime_error(
        "was made with another robot.toml or robot.urdf; choose another folder");
  }
}

Rollout LoadRollout(const std::filesystem::path& file, const RobotDescription& robot) {
  Rollout rollout = RolloutFrom(ReadJson(file));
  RequireTransitions(rollout, robot);
  return rollout;
}

// As the message that carries it, in hexadecimal digits; null if there is none.
json ToJson(const std::shared_ptr<const Residual>& residual, const RobotDescription& robot) {
  if (!residual) return nullptr;
  ParameterDistribution distribution = ParameterDistribution::Prior(robot);
  distribution.residual = residual;
  return fmt::format("{:02x}", fmt::join(Encode(distribution.ToMessage()), ""));
}

std::shared_ptr<const Residual> ResidualFrom(const json& j, const RobotDescription& robot) {
  if (j.is_null()) return nullptr;
  const auto digits = j.get<std::string>();
  std::vector<uint8_t> bytes(digits.size() / 2);
  bool good = digits.size() % 2 == 0;
  for (size_t i = 0; i < bytes.size(); ++i) {
    const char* const begin = digits.data() + 2 * i;
    good = good && std::from_chars(begin, begin + 2, bytes[i], 16).ptr == begin + 2;
  }
  parameter_distribution_t message;
  if (!good || !Decode(bytes, message)) throw std::runtime_error("the residual is none");
  return ParameterDistribution::FromMessage(message, robot).residual;
}

}  // namespace

std::vector<Rollout> LoadRollouts(const std::filesystem::path& folder,
                                  const RobotDescription& robot) {
  std::vector<Rollout> rollouts;
  std::filesystem::path file = folder / kStateFile;
  if (!std::filesystem::exists(file)) return rollouts;
  try {
    const json j = ReadJson(file);
    RequireRobot(j, robot);
    // An earlier, longer run may have left more of them.
    const size_t count = Count(WholeNumbers(j.at("rollouts_per_iteration")));
    while (rollouts.size() < count) {
      file = folder / RolloutFile(rollouts.size());
      rollouts.push_back(LoadRollout(file, robot));
    }
    return rollouts;
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  }
}

CalibrationCheckpoint::CalibrationCheckpoint(std::filesystem::path folder,
                                             const RobotDescription& robot, uint64_t seed)
    : folder_(std::move(folder)), robot_(robot), seed_(seed) {
  MakeFolder(folder_);
  RemoveLeftovers(folder_, ".checkpoint");
}

void CalibrationCheckpoint::Save(const SimOpt::State& state) {
  const auto forgotten = static_cast<size_t>(state.forgotten);
  saved_rollouts_ = std::max(saved_rollouts_, forgotten);
  for (; saved_rollouts_ < forgotten + state.rollouts.size(); ++saved_rollouts_) {
    WriteJson(folder_ / RolloutFile(saved_rollouts_),
              ToJson(state.rollouts[saved_rollouts_ - forgotten]));
  }
  const json j{{"robot", robot_.name},
               {"parameters", ParameterNames(robot_)},
               {"seed", seed_},
               {"fingerprint", robot_.fingerprint},
               {"iteration", state.iteration},
               {"update", state.search.update},
               {"distribution", ToJson(state.distribution)},
               {"method", state.method},
               {"used", state.used},
               {"before", ToJson(state.before)},
               {"kl", state.kl},
               {"ess", state.ess},
               {"temperature", state.temperature},
               {"search", ToJson(state.search)},
               {"warnings", state.warnings},
               {"residual", ToJson(state.residual, robot_)},
               {"explained", state.explained},
               {"alarm", state.alarm},
               {"gap", state.gap},
               {"informed", Name(state.informed)},
               {"information", ToJson(state.information.reshaped())},
               {"rollouts_per_iteration", state.rollouts_per_iteration},
               {"forgotten", state.forgotten}};
  WriteJson(folder_ / kStateFile, j);
}

std::optional<SimOpt::State> CalibrationCheckpoint::Load() const {
  std::filesystem::path file = folder_ / kStateFile;
  if (!std::filesystem::exists(file)) return {};
  try {
    const json j = ReadJson(file);
    RequireRobot(j, robot_);
    if (j.at("seed") != seed_) throw std::runtime_error("has another seed; choose another folder");
    SimOpt::State state;
    state.iteration = Whole(j.at("iteration"));
    state.distribution = MixtureFrom(j.at("distribution"));
    state.method = j.at("method"), state.used = j.at("used");
    state.before = MixtureFrom(j.at("before"));
    state.kl = j.at("kl"), state.ess = NumberOrNaN(j.at("ess")),
    state.temperature = j.at("temperature");
    state.search = {.update = Whole(j.at("update")),
                    .distribution = Moments(state.distribution),
                    .kl = state.kl,
                    .temperature = state.temperature,
                    .ess = state.ess};
    ReadSamples(j.at("search"), &state.search);
    state.warnings = j.at("warnings").get<std::vector<std::string>>();
    state.residual = ResidualFrom(j.at("residual"), robot_);
    state.explained = j.at("explained");
    state.alarm = j.at("alarm"), state.gap = j.at("gap");
    state.informed = InformedFrom(j.at("informed"));
    state.information = InformationFrom(j.at("information"), state.search.distribution.mean.size());
    state.rollouts_per_iteration = WholeNumbers(j.at("rollouts_per_iteration"));
    const size_t count = Count(state.rollouts_per_iteration);
    state.forgotten = Whole(j.at("forgotten"));
    if (state.forgotten < 0) throw std::runtime_error("forgotten: less than none");
    for (auto i = static_cast<size_t>(state.forgotten); i < count; ++i) {
      file = folder_ / RolloutFile(i);
      state.rollouts.push_back(LoadRollout(file, robot_));
    }
    return state;
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  }
}

}  // namespace plumb
