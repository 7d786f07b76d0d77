#pragma once

#include <string>
#include <vector>

#include "common/config.h"

namespace plumb {

/// [calibration]: of the live calibrator.
struct CalibrationSettings {
  std::string method;  ///< one of LiveMethods(), see SimOpt
  int samples, updates;
  double kl, min_temperature;
  std::vector<int> horizons;
  /// What the simulator lacks is learnt where the alarm speaks: calibrator/gap/gap.h
  bool residual = true;
  /// Else auto, laplace and mixture use positions alone, as if nobody had read velocities: a
  /// smoother smears what dry friction and play do between two commands.
  bool velocities = true;
  double duration = 0;  ///< [s] >= 0 that a calibration takes in virtual time
};

/// The methods of calibration that the loop has.
const std::vector<std::string>& LiveMethods();

/// Thread-safe. @throws ConfigError
CalibrationSettings ReadCalibration(Config config);

}  // namespace plumb
