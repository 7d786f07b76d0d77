#pragma once

#include <cmath>

#include "calibrator/motion/transitions.h"
#include "tests/calibrator/synthetic.h"

namespace plumb {

/// A pendulum's state, as the estimator has smoothed it: one every 5 ms.
inline robot_state_t SmoothedState(int64_t sequence) {
  robot_state_t s{};
  s.sequence = sequence;
  s.utime = 7'000'000 + 5000 * sequence;
  s.num_positions = s.num_velocities = 1;
  s.q = {0.001 * static_cast<double>(sequence)};
  s.v = {0.2};
  s.q_sd = {1e-4};
  s.v_sd = {1e-2};
  s.effort = {0.01 * static_cast<double>(sequence)};
  s.valid = 1;
  return s;
}

/// The command of a step of episode 42, which acts on every tenth state.
inline joint_command_t StepCommand(int step) {
  joint_command_t c{};
  c.state_sequence = 100 + 10 * step;
  c.episode = 42;
  c.step = step;
  c.num_joints = 1;
  c.effort = {1};
  c.position = c.velocity = c.kp = c.kd = {NAN};
  return c;
}

/// 20 steps of 10 states each, from sequence 100 to 300.
struct RecordedEpisode {
  RobotDescription robot = Pendulum();
  TransitionJoiner joiner{robot};
  void States(int64_t from = 90, int64_t to = 310) {
    for (int64_t i = from; i <= to; ++i) joiner.OnState(SmoothedState(i));
  }
  void Commands() {
    for (int i = 0; i < 20; ++i) joiner.OnCommand(StepCommand(i));
  }
};

}  // namespace plumb
