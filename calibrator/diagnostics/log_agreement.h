#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "calibrator/inference/laplace.h"
#include "common/gaussian.h"
#include "robot/description.h"

namespace plumb {

/// A log that was fitted on its own.
struct LogFit {
  std::string log;  ///< its name
  LaplaceFit fit;   ///< in the robot's coordinates
};

/// How far a log is from the others.
struct LogAgreement {
  std::string log;
  Eigen::VectorXd mean, sd;  ///< of its own posterior, physical units
  double distance;           ///< Mahalanobis' from the others' together, in what the log can tell
  /// of such a distance if all logs were of one robot, corrected for the number of logs
  double p;
};

/// Whether logs are of one robot, and what tells so.
struct Agreement {
  bool agree = true;
  std::vector<LogAgreement> logs;  ///< empty for a single log
  std::string summary;
};

/// Each log's likelihood against that of the others together, both quadratic: if all are of one
/// robot, their modes differ by a normal vector with the sum of both covariances, in the directions
/// that both determine. Logs whose p is below 0.001 do not agree. Thread-safe.
/// @param prior of the coordinates, independent. @param fits with that prior.
Agreement CompareLogs(const RobotDescription& robot, const Gaussian& prior,
                      std::span<const LogFit> fits);

}  // namespace plumb
