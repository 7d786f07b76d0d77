#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "calibrator/motion/transitions.h"
#include "robot/configuration_space.h"
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

  /// States are columns of 2 n numbers: q's ConfigurationSpace::Coordinates about the recorded
  /// state, and v. Where a transition goes on from the one before, that one's end and its own
  /// beginning are counted about the same.

  /// At each transition's beginning, as recorded: 2 n x steps.
  Eigen::MatrixXd Starts() const;
  /// At each transition's end, 2 n x steps; NaN where the simulation fails.
  /// @param physical of the model's parameters. @param starts like Starts(), finite.
  Eigen::MatrixXd Predict(const Eigen::VectorXd& physical, const Eigen::MatrixXd& starts);

  /// q of a column: of step k at its beginning, and at its end.
  Eigen::VectorXd StartPositions(size_t k, const Eigen::VectorXd& state) const;
  Eigen::VectorXd EndPositions(size_t k, const Eigen::VectorXd& state) const;

  int64_t simulated_steps() const { return simulated_steps_; }  ///< of all calls

 private:
  const Eigen::VectorXd& EndAbout(size_t k) const;

  Windows simulate_;
  ConfigurationSpace space_;
  std::vector<Step> steps_;
  std::vector<Window> windows_;
  int64_t simulated_steps_ = 0;
};

}  // namespace plumb
