#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "calibrator/inference/prior.h"
#include "calibrator/motion/transitions.h"
#include "robot/configuration_space.h"
#include "sim/model.h"
#include "sim/windows.h"

namespace plumb {

/// A transition of roll-outs, and what of it has been observed.
struct ObservedTransition {
  size_t rollout, index;         ///< among the roll-outs, and in its own
  std::vector<int> coordinates;  ///< observed entries of (q, v) at its end
  bool start_uncertain;
};

/// The errors of any transitions against a robot's record, linearised about parameters and
/// whitened: WindowErrors of one step, of roll-outs that may still become longer. Points are
/// standard coordinates, see Prior; n velocities, p parameters. Not thread-safe; works in the
/// caller's thread.
class TransitionErrors {
 public:
  explicit TransitionErrors(std::shared_ptr<const Model> model);

  const Model& model() const { return windows_.model(); }
  const Prior& prior() const { return prior_; }

  ObservedTransition Observe(std::span<const Rollout> rollouts, size_t rollout, size_t index) const;

  /// Of each transition observed x (1 + p): whitened errors, predicted minus recorded, and their
  /// slopes by forward differences; backward where forward is no simulator, zero where neither is
  /// one. Empty where nothing was observed or it cannot be simulated.
  /// @param noise_sd of each entry of (q, v), physical units, where the record does not say.
  /// @throws std::invalid_argument if a transition cannot be a window, see Windows::Predict.
  std::vector<Eigen::MatrixXd> Linearise(std::span<const Rollout> rollouts,
                                         std::span<const ObservedTransition* const> transitions,
                                         const Eigen::VectorXd& at,
                                         const Eigen::VectorXd& noise_sd);

  int64_t simulated_steps() const { return simulated_steps_; }  ///< of all calls

 private:
  using Recorded = std::vector<const Transition*>;
  Eigen::MatrixXd Predict(const Eigen::MatrixXd& standard, std::span<const Window> windows,
                          const Recorded& recorded);
  std::vector<Eigen::MatrixXd> StartSensitivities(
      std::span<const ObservedTransition* const> transitions, const Recorded& recorded,
      std::span<const Window> windows, const Eigen::VectorXd& at, const Eigen::VectorXd& middle,
      const Eigen::VectorXd& noise_sd);

  Windows windows_;
  Prior prior_;
  ConfigurationSpace space_;
  Eigen::Index n_, p_;
  int64_t simulated_steps_ = 0;
};

}  // namespace plumb
