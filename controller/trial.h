#pragma once

namespace plumb {

/// A policy's episode on the robot without exploration, as far as it went.
struct Trial {
  int steps = 0;
  double sum_of_rewards = 0;
  double late_rate = 0;  ///< mean reward of a step, of the trial's second half
  bool fell = false;     ///< ended by the task; else by time

  /// Adds a control step's reward. @param planned steps of the whole trial, >= 1.
  void Add(double reward, int planned);
  /// What it would have been over a whole episode at its late rate. @param episode_steps >= steps
  double WholeReturn(int episode_steps) const;
};

}  // namespace plumb
