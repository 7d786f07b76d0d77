#pragma once

namespace plumb {

/// A policy's episode on the robot without exploration, as far as it went.
struct Trial {
  int steps = 0;
  double sum_of_rewards = 0;
  double late_rate = 0;  ///< mean reward of a step, of the trial's second half
  bool fell = false;     ///< ended by the task; else by time

  /// One that did not come to its end, as the driver or a late state stopped it, has failed and
  /// earns nothing more. Where steps cost it goes on to pay what they did, or being stopped would
  /// be the cheapest episode of all.
  static Trial Stopped(int steps, double sum_of_rewards);

  /// Adds a control step's reward. @param planned steps of the whole trial, >= 1.
  void Add(double reward, int planned);
  /// What would have followed at its late rate; nothing where it fell. @param further_steps >= 0
  double Continuation(double further_steps) const;
  /// What it would have been over a whole episode at its late rate. @param episode_steps >= steps
  double WholeReturn(int episode_steps) const {
    return sum_of_rewards + Continuation(episode_steps - steps);
  }
};

}  // namespace plumb
