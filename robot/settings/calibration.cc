#include "robot/settings/calibration.h"

#include "robot/settings/ranges.h"

namespace plumb {

const std::vector<std::string>& LiveMethods() {
  static const std::vector<std::string> methods{"auto", "laplace", "mixture", "reps", "simopt"};
  return methods;
}

CalibrationSettings ReadCalibration(Config config) {
  CalibrationSettings s;
  s.method = LiveMethods()[static_cast<size_t>(config.Choice("method", LiveMethods(), 0))];
  s.samples = config.Integer("samples", {4, 1e6});
  s.updates = config.Integer("updates", {1, 1000});
  s.kl = config.Number("kl", kSanePositive);
  s.min_temperature = config.Number("min_temperature", kSanePositive);
  s.horizons = config.Integers("horizons", {1, 10000});
  if (s.horizons.empty()) config.Fail("horizons", "is empty");
  s.residual = config.Boolean("residual", true);
  s.velocities = config.Boolean("velocities", true);
  s.duration = config.Number("duration", {0, 1e6}, 0);
  config.Finish();
  return s;
}

}  // namespace plumb
