#pragma once

#include <nlohmann/json.hpp>

namespace plumb {

/// As docs/summary.md has it: two iterations of the pendulum, of which the second one's policy was
/// not accepted.
inline nlohmann::json SampleSummary() {
  return nlohmann::json::parse(R"summary({
    "robot": "pendulum", "bus": "loop:", "seed": 7, "time": "virtual", "version": "plumb 1",
    "parameters": ["gravity", "mass/pole", "length/pole"], "hidden": [10.25, 1.125, 1.0625],
    "iterations": [
      {"iteration": 1, "alarm": "", "gap": "", "mean": [10.2, 1.1, 1.05], "sd": [0.4, 0.08, 0.04],
       "combinations": [{"name": "gravity / length", "mean": 9.5, "sd": 0.01, "hidden": 9.51}],
       "discrepancy": 0.5, "prior_discrepancy": 9, "horizons": [1, 5], "error": [0.003, 0.01],
       "error_after": [0.001, 0.002], "error_prior": [0.003, 0.01], "kl": 0.4, "ess": null,
       "transitions": 150, "simulated_return": -1234, "robot_return": -1357, "seconds": 4.5},
      {"iteration": 2, "alarm": "friction", "gap": "explains 83 %", "mean": [10.3, 1.12, 1.06],
       "sd": [0.2, 0.04, 0.02],
       "combinations": [{"name": "gravity / length", "mean": 9.6, "sd": 0.02, "hidden": 9.51}],
       "discrepancy": 3.5, "prior_discrepancy": 9, "horizons": [1, 5], "error": [0.002, 0.007],
       "error_after": [0.001, 0.002], "error_prior": [0.003, 0.01], "kl": 0.1, "ess": null,
       "transitions": 300, "simulated_return": -987, "robot_return": -2468, "seconds": 3.5}],
    "identifiability": "only gravity / length can be known",
    "policy": {"iteration": 0, "since": 0, "why": "policy 0 is the first (-1357)"},
    "decisions": [
      {"policy": 0, "accepted": true, "probability": 0.5, "return": -1357,
       "incumbent_return": -1357, "summary": "policy 0 is the first (-1357)"},
      {"policy": 1, "accepted": false, "probability": 0.125, "return": -2468,
       "incumbent_return": -1357, "summary": "policy 1 not accepted"}],
    "evaluation_returns": [-1300, -1500, -1400], "dropped_episodes": 0, "rearms": 0,
    "seconds": {"robot": 30, "training": 12, "other": 3, "total": 45}})summary");
}

}  // namespace plumb
