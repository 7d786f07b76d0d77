#include "cli/reading_noise.h"

#include <charconv>
#include <cmath>
#include <stdexcept>
#include <string_view>

#include "robot/configuration_space.h"

namespace plumb {
namespace {

/// @return NaN if the text is no number that a standard deviation can be.
double ParseSd(std::string_view text) {
  double sd = NAN;
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), sd);
  const bool whole = error == std::errc() && rest == text.data() + text.size();
  return whole && std::isfinite(sd) && sd >= 0 ? sd : NAN;
}

}  // namespace

void ReadingNoise::Add(const RobotDescription& robot, Random& random, Eigen::VectorXd& q_read,
                       Eigen::VectorXd& v_read) const {
  Eigen::VectorXd step(v_read.size());
  for (double& entry : step) entry = q * random.Normal();
  q_read = ConfigurationSpace(robot).Move(q_read, step);
  for (double& velocity : v_read) velocity += v * random.Normal();
}

ReadingNoise ParseReadingNoise(const std::string& text) {
  const std::string_view all = text;
  const size_t comma = all.find(',');
  const double q = ParseSd(all.substr(0, comma)),
               v = comma == all.npos ? q : ParseSd(all.substr(comma + 1));
  if (std::isnan(q) || std::isnan(v)) {
    throw std::invalid_argument(
        "--noise " + text +
        ": expected a standard deviation of all readings, or two as in 0.001,0.05: of positions "
        "[rad or m] and of velocities [rad/s or m/s]; neither negative, both finite");
  }
  return {q, v};
}

}  // namespace plumb
