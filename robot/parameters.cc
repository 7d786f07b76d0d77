#include "robot/parameters.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

namespace plumb {
namespace {

using Coordinate = ParameterDescription::Coordinate;

constexpr size_t kMaxParameters = 500;  // messages carry a covariance of them
// Orders of magnitude beyond physics; within them no moment of a prior overflows.
constexpr Range kSane{-1e12, 1e12}, kSanePositive{1e-12, 1e12}, kVariance{1e-30, 1e24};

// Both are finite, and strictly between the bounds, whatever comes in but NaN.
double Logit(const ParameterDescription& p, double value) {
  const double lowest = std::nextafter(p.lower, p.upper),
               highest = std::nextafter(p.upper, p.lower);
  const double inside = std::clamp(value, lowest, highest);  // NaN stays
  return std::log(inside - p.lower) - std::log(p.upper - inside);
}

double FromLogit(const ParameterDescription& p, double x) {
  const double e = std::exp(-std::abs(x)), share = e / (1 + e);  // of the way from the nearer bound
  const double value =
      x < 0 ? p.lower + (p.upper - p.lower) * share : p.upper - (p.upper - p.lower) * share;
  return std::clamp(value, std::nextafter(p.lower, p.upper), std::nextafter(p.upper, p.lower));
}

FrozenParameter ReadFrozen(Config& config, const std::string& name) {
  if (config.Has("unit")) config.String("unit");
  const double value = config.Number("mean", kSane);
  for (const char* key : {"coordinate", "variance", "lower", "upper"}) {
    if (config.Has(key)) config.Fail(key, "has no effect on a frozen parameter");
  }
  return {name, value};
}

ParameterDescription ReadParameter(Config& config, const std::string& name) {
  ParameterDescription p;
  p.name = name;
  p.unit = config.String("unit");
  constexpr std::array kCoordinates{Coordinate::kLinear, Coordinate::kLog, Coordinate::kLogit};
  p.coordinate =
      kCoordinates[static_cast<size_t>(config.Choice("coordinate", {"linear", "log", "logit"}))];
  p.mean = config.Number("mean", p.coordinate == Coordinate::kLog ? kSanePositive : kSane);
  p.variance = config.Number("variance", kVariance);
  if (p.coordinate == Coordinate::kLogit) {
    p.lower = config.Number("lower", kSane);
    p.upper = config.Number("upper", kSane);
    if (!(p.lower < p.mean)) config.Fail("lower", "must be below mean");
    if (!(p.mean < p.upper)) config.Fail("upper", "must be above mean");
    // Nothing between the bounds has more: that is what half the robots at either bound would have.
    if (!(p.variance < (p.mean - p.lower) * (p.upper - p.mean))) {
      config.Fail("variance",
                  fmt::format("= {} is more than a value between the bounds can have, {}",
                              p.variance, (p.mean - p.lower) * (p.upper - p.mean)));
    }
  } else {
    for (const char* key : {"lower", "upper"}) {
      if (config.Has(key)) config.Fail(key, "is for coordinate = \"logit\" only");
    }
  }
  const double variance = p.coordinate_variance();
  if (!(variance > 0) || !std::isfinite(variance) || !std::isfinite(p.coordinate_mean())) {
    config.Fail("variance", "is too small or too large for this mean");
  }
  return p;
}

}  // namespace

void ReadParameters(Config& root, std::vector<ParameterDescription>& parameters,
                    std::vector<FrozenParameter>& frozen) {
  std::set<std::string> names;
  for (Config& config : root.Tables("parameter")) {
    const std::string name = config.String("name");
    if (!names.insert(name).second) config.Fail("name", fmt::format("= \"{}\" occurs twice", name));
    if (names.size() > kMaxParameters)
      config.Fail("name", fmt::format("is that of one more than {} parameters", kMaxParameters));
    if (config.Boolean("frozen", false)) {
      frozen.push_back(ReadFrozen(config, name));
    } else {
      parameters.push_back(ReadParameter(config, name));
    }
    config.Finish();
  }
  if (parameters.empty())
    root.Fail("parameter", "is missing: at least one [[parameter]] that is not frozen");
}

bool Covers(const std::string& name, const std::string& path) {
  return name == path || fnmatch(name.c_str(), path.c_str(), FNM_PATHNAME | FNM_NOESCAPE) == 0;
}

double ParameterDescription::coordinate_variance() const {
  switch (coordinate) {
    case Coordinate::kLog:
      return std::log1p(variance / (mean * mean));
    case Coordinate::kLogit: {
      const double derivative = 1 / (mean - lower) + 1 / (upper - mean);
      return variance * derivative * derivative;
    }
    default:
      return variance;
  }
}

double ParameterDescription::coordinate_mean() const {
  switch (coordinate) {
    case Coordinate::kLog:
      return std::log(mean) - coordinate_variance() / 2;
    case Coordinate::kLogit:
      return Logit(*this, mean);
    default:
      return mean;
  }
}

double ParameterDescription::ToPhysical(double value) const {
  switch (coordinate) {
    case Coordinate::kLog:
      return std::exp(value);
    case Coordinate::kLogit:
      return FromLogit(*this, value);
    default:
      return value;
  }
}

double ParameterDescription::ToCoordinate(double value) const {
  switch (coordinate) {
    case Coordinate::kLog:
      return std::log(value);
    case Coordinate::kLogit:
      return Logit(*this, value);
    default:
      return value;
  }
}

Eigen::VectorXd ToPhysical(const std::vector<ParameterDescription>& parameters,
                           const Eigen::VectorXd& coordinates) {
  Eigen::VectorXd physical(coordinates.size());
  for (Eigen::Index i = 0; i < physical.size(); ++i) {
    physical[i] = parameters[static_cast<size_t>(i)].ToPhysical(coordinates[i]);
  }
  return physical;
}

}  // namespace plumb
