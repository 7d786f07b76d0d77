#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "calibrator/motion/transitions.h"
#include "sim/model.h"
#include "sim/windows.h"

namespace plumb {

/// The transitions of roll-outs, simulated from any states: f(s), with the efforts that were
/// recorded. Not thread-safe; the same bits for any number of threads.
class OneStep {
 public:
  /// A transition: where it is, and whether it begins where the one before it has ended.
  struct Step {
    int rollout, transition;
    bool goes_on;
    const Transition* recorded;
  };

  /// @param rollouts must outlive this.
  OneStep(std::shared_ptr<const Model> model, std::span<const Rollout> rollouts, int threads);

  const std::vector<Step>& steps() const { return steps_; }
  Eigen::Index num_velocities() const { return simulate_.model().num_velocities(); }

  /// (q, v) at each transition's beginning, as recorded: 2 n x steps.
  Eigen::MatrixXd Starts() const;
  /// (q, v) at each transition's end, 2 n x steps; NaN where the simulation fails.
  /// @param physical of the model's parameters. @param starts like Starts(), finite.
  Eigen::MatrixXd Predict(const Eigen::VectorXd& physical, const Eigen::MatrixXd& starts);

  int64_t simulated_steps() const { return simulated_steps_; }  ///< of all calls

 private:
  Windows simulate_;
  std::vector<Step> steps_;
  std::vector<Window> windows_;
  int64_t simulated_steps_ = 0;
};

}  // namespace plumb
