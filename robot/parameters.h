#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "common/config.h"

namespace plumb {

/// One uncertain simulator parameter, named by a path such as "gravity", "mass/pole", "delay/hip":
/// see sim/parameters.h. With a wildcard it is one number for parts that are alike:
/// "friction/*_hip".
struct ParameterDescription {
  enum class Coordinate { kLinear, kLog, kLogit };
  std::string name;
  std::string unit;
  Coordinate coordinate;
  double mean;      ///< prior mean, physical units
  double variance;  ///< prior variance, physical units squared
  /// kLogit: bounds, physical units; lower < mean < upper
  double lower = -std::numeric_limits<double>::infinity();
  double upper = std::numeric_limits<double>::infinity();
  /// Prior in the coordinate. For kLog the Gaussian whose log-normal has that mean and variance:
  /// s^2 = ln(1 + variance/mean^2), m = ln(mean) - s^2/2. For kLogit, x = ln((p - lower) / (upper -
  /// p)), the one that has them to first order: m = x(mean), s^2 = variance * x'(mean)^2.
  double coordinate_mean() const;
  double coordinate_variance() const;
  double ToPhysical(double coordinate_value) const;
  double ToCoordinate(double physical_value) const;
};

/// The parameters' coordinates -> physical units: one value per parameter, in their order.
/// Thread-safe.
Eigen::VectorXd ToPhysical(const std::vector<ParameterDescription>& parameters,
                           const Eigen::VectorXd& coordinates);

/// Whether a parameter of that name is what is at `path`, or one number for it and others: `name`
/// may have the wildcards of fnmatch(3), of which none stands for a slash. Thread-safe.
bool Covers(const std::string& name, const std::string& path);

/// A parameter with a known value, which replaces that of the URDF and of robot.toml's tables.
struct FrozenParameter {
  std::string name;
  double value;  ///< physical units
};

/// The [[parameter]] tables: those to be inferred, and those with frozen = true. The simulator
/// checks their names (sim/parameter_paths.h). Thread-safe. @throws ConfigError
void ReadParameters(Config& root, std::vector<ParameterDescription>& parameters,
                    std::vector<FrozenParameter>& frozen);

}  // namespace plumb
