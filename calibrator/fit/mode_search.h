#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "calibrator/inference/laplace.h"
#include "calibrator/inference/prior.h"
#include "calibrator/motion/transitions.h"
#include "common/batch_runner.h"
#include "sim/model.h"

namespace plumb {

// The search for a posterior's modes from several first guesses, quick and on a part of the
// transitions: each of them has to be fitted to all. Points are coordinates. Thread-safe; threads
// as ExecutionOptions says.

/// By how much another mode may explain the transitions worse and still count [nat].
inline constexpr double kWorthless = 12;

struct FoundModes {
  std::vector<Eigen::VectorXd> modes;         ///< at least one, the best explanation first
  int impossible = 0;                         ///< first guesses that could not be simulated
  int64_t simulations = 0;                    ///< see LaplaceFit
  int64_t simulated_steps = 0, failures = 0;  ///< see WindowErrors
};

/// `start`, and draws of the prior. @param count in all. @param start empty = the prior's mean.
std::vector<Eigen::VectorXd> FirstGuesses(const Prior& prior, int count, uint64_t seed,
                                          const Eigen::VectorXd& start);

/// Modes that the guesses lead to, each once, without those that explain their part of the
/// transitions much worse than the best one does. Ends early where nothing is left to explain.
/// @param horizon control steps of each window. @param windows of these there are.
/// @param progress told after each guess how many have led to a mode; may throw to break off.
/// @throws std::invalid_argument if no first guess can be simulated, and see WindowErrors.
FoundModes SearchModes(const std::shared_ptr<const Model>& model, std::span<const Rollout> rollouts,
                       int horizon, int64_t windows, std::span<const Eigen::VectorXd> guesses,
                       const ExecutionOptions& execution,
                       const std::function<void(size_t led)>& progress);

/// Whether they are further from each other than one mode that was found twice would be.
bool AreDistinct(const LaplaceFit& a, const LaplaceFit& b);

}  // namespace plumb
