#include "robot/posterior_reader.h"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "common/decompositions.h"
#include "robot/physics_fingerprint.h"
#include "robot/posterior_format.h"

namespace plumb {
namespace {

using nlohmann::json;

constexpr std::uintmax_t kMaxBytes = 256 << 20;
constexpr size_t kMaxComponents = 1000;
constexpr double kRounding = 1e-9;

/// A value of the file, and the way to it for complaints.
class Field {
 public:
  Field(const json& value, std::string path) : value_(value), path_(std::move(path)) {}

  [[noreturn]] void Fail(const std::string& what) const {
    throw std::runtime_error(path_ + ": " + what);
  }
  void Require(bool holds, const std::string& what) const {
    if (!holds) Fail(what);
  }

  Field operator[](const char* key) const {
    Require(value_.is_object(), "is not an object");
    const auto found = value_.find(key);
    const std::string path = path_.empty() ? key : path_ + "." + key;
    if (found == value_.end()) Field(value_, path).Fail("is missing");
    return {*found, path};
  }
  /// The entries of an array of `size`.
  std::vector<Field> Entries(size_t size) const {
    Require(value_.is_array(), "is not an array");
    Require(value_.size() == size, fmt::format("has {} entries, expected {}", value_.size(), size));
    std::vector<Field> entries;
    for (size_t i = 0; i < size; ++i)
      entries.emplace_back(value_[i], fmt::format("{}[{}]", path_, i));
    return entries;
  }
  size_t size() const {
    Require(value_.is_array(), "is not an array");
    return value_.size();
  }
  double Number() const {
    Require(value_.is_number(), "is not a number");
    const auto number = value_.get<double>();
    Require(std::isfinite(number), "is not finite");
    return number;
  }
  std::string Text() const {
    Require(value_.is_string(), "is not a string");
    return value_.get<std::string>();
  }
  void RequireText(const std::string& expected, const std::string& otherwise) const {
    Require(Text() == expected, fmt::format("{}: it is \"{}\", expected \"{}\"", otherwise,
                                            Text().substr(0, 80), expected));
  }
  Eigen::VectorXd Vector(size_t size) const {
    Eigen::VectorXd vector(size);
    Eigen::Index i = 0;
    for (const Field& entry : Entries(size)) vector(i++) = entry.Number();
    return vector;
  }
  Eigen::MatrixXd Matrix(size_t size) const {
    const std::vector<Field> rows = Entries(size);
    Eigen::MatrixXd matrix(size, size);
    for (size_t i = 0; i < size; ++i)
      matrix.row(static_cast<Eigen::Index>(i)) = rows[i].Vector(size);
    return matrix;
  }

 private:
  const json& value_;
  std::string path_;
};

std::string ReadText(const std::filesystem::path& file) {
  if (!std::filesystem::is_regular_file(file)) throw std::runtime_error("there is no such file");
  if (std::filesystem::file_size(file) > kMaxBytes)
    throw std::runtime_error("is longer than 256 MB");
  std::ifstream stream(file, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(stream), {});
  if (!stream) throw std::runtime_error("cannot be read");
  return text;
}

void RequireRobot(const Field& root, const RobotDescription& robot) {
  root["format"].RequireText(kPosteriorFormat, "is not a posterior");
  const double version = root["version"].Number();
  root["version"].Require(version == kPosteriorVersion,
                          fmt::format("is {}, this program reads {}", version, kPosteriorVersion));
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
  covariance.Require(
      (c - c.transpose()).cwiseAbs().maxCoeff() <= kRounding * c.cwiseAbs().maxCoeff(),
      "is not symmetric");
  covariance.Require(Eigen::LLT<Eigen::MatrixXd>(c).info() == Eigen::Success,
                     "is not positive definite");
  return component;
}

ParameterDistribution ReadMixture(const Field& mixture, const RobotDescription& robot) {
  const size_t count = mixture["weights"].size(), n = robot.parameters.size();
  mixture["weights"].Require(count >= 1 && count <= kMaxComponents,
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
  mixture["weights"].Require(std::abs(total - 1) <= kRounding,
                             fmt::format("sum to {}, not to 1", total));
  mixture.Require(distribution.Mean().allFinite() && distribution.Sd().allFinite(),
                  "is too wide: its moments overflow");
  return distribution;
}

}  // namespace

ParameterDistribution ReadPosterior(const std::filesystem::path& file,
                                    const RobotDescription& robot) {
  try {
    const json j = json::parse(ReadText(file));
    const Field root(j, "");
    if (!j.is_object()) throw std::runtime_error("is not a posterior");
    RequireRobot(root, robot);
    return ReadMixture(root["mixture"], robot);
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  }
}

}  // namespace plumb
