#pragma once

#include <ctime>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "calibrator/fit/method.h"
#include "calibrator/motion/log.h"
#include "calibrator/results/findings.h"
#include "robot/description.h"

namespace plumb {

/// Where findings come from, as far as they do not say it themselves. Empty for the loop's, which
/// are the same to the byte whether its messages are live or read from a log.
struct Provenance {
  std::vector<std::string> logs;               ///< names of the files
  std::map<std::string, std::string> options;  ///< that the result depends on, by name
  /// the line that does it again; may depend on the machine
  std::string command;
  std::string date;  ///< ISO 8601, UTC
};

/// Of a calibration of these logs. @param command see Provenance. @param now Unix time [s].
/// Thread-safe.
Provenance ProvenanceOf(std::span<const Log> logs, const CalibrationOptions& options,
                        const std::string& command, std::time_t now);

/// The contents of posterior.json; docs/posterior.md has its schema. What may differ between two
/// runs of the same calibration is in its last object, "run": all that comes before it is the same
/// to the byte. Numbers read back to the same bits; those that are not finite are null, and bytes
/// that are not UTF-8 are replaced.
/// @throws std::invalid_argument as Summarise does. Thread-safe.
std::string PosteriorJson(const Findings& findings, const RobotDescription& robot,
                          const Provenance& provenance);

/// The same into a file, atomically. @throws std::runtime_error too, naming the file, if it cannot
/// be written.
void WritePosterior(const std::filesystem::path& file, const Findings& findings,
                    const RobotDescription& robot, const Provenance& provenance);

}  // namespace plumb
