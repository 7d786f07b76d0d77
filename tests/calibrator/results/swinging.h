#pragma once

#include <string>
#include <vector>

#include "calibrator/results/calibration.h"
#include "common/special_numbers.h"
#include "tests/calibrator/synthetic.h"

namespace plumb {

inline const Eigen::Vector3d kSwingingTruth(9.5, 1.1, 0.95);

/// A pendulum that swings, of noise that nobody tells.
inline Log Swinging(const std::string& name, const Eigen::VectorXd& truth, int rollouts,
                    uint32_t stream, int steps = 60) {
  Log log;
  log.name = name;
  for (int i = 0; i < rollouts; ++i) {
    log.rollouts.push_back(
        SyntheticRollout(Pendulum(), truth, steps, 1e-3, 5e-3, stream + static_cast<uint32_t>(i)));
    for (Transition& t : log.rollouts.back().transitions) {
      for (Eigen::VectorXd* sd : {&t.q_sd, &t.v_sd, &t.next_q_sd, &t.next_v_sd})
        sd->setConstant(kNaN);
    }
  }
  return log;
}

inline Findings Of(const std::vector<Log>& logs, const std::string& method = "auto",
                   int64_t budget = 20'000) {
  CalibrationOptions options;
  options.method = method;
  options.budget = budget;
  options.horizons = {1, 5};
  return Calibrate(Pendulum(), logs, options);
}

}  // namespace plumb
