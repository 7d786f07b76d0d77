#include "cli/calibrate_sbc.h"

#include <algorithm>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "calibrator/diagnostics/robot_sbc.h"
#include "calibrator/motion/differences.h"
#include "calibrator/results/calibration.h"

namespace plumb {

int JudgePosteriors(const RobotDescription& robot, const std::vector<Log>& logs,
                    const CalibrationOptions& options, int runs, bool strict) {
  RequireVelocities(robot, logs, "simulation-based calibration");
  CalibrationOptions for_noise = options;  // of which nothing else is needed
  for_noise.method = "laplace", for_noise.horizons = {1}, for_noise.residual = false;
  const Findings findings = Calibrate(robot, logs, for_noise);
  const std::vector<Rollout> rollouts = RolloutsOf(logs);
  RobotSbcOptions sbc;
  sbc.runs = runs, sbc.seed = options.seed, sbc.threads = options.execution.threads;
  sbc.progress = [&](double share) { options.progress("simulation-based calibration", share); };
  const SbcResult result =
      RunRobotSbc(std::make_shared<Model>(robot), rollouts, findings.noise_sd, sbc);
  std::cout << SbcSummary(result) << std::flush;
  const std::vector<std::string> verdicts = SbcVerdicts(result);
  const bool calibrated = std::ranges::all_of(
      verdicts, [](const std::string& verdict) { return verdict == kSbcCalibrated; });
  return strict && !calibrated ? 3 : 0;
}

}  // namespace plumb
