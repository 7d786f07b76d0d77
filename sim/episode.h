#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>

#include "common/random.h"
#include "robot/description.h"
#include "sim/environment.h"

namespace plumb {

/// Action in policy units for an observation. @param random of the episode.
using Actor = std::function<Eigen::VectorXf(const Eigen::VectorXf& observation, Random& random)>;

/// Motors without effort.
Actor NoAction(int action_size);
/// Each action uniform in [-1, 1), every time another.
Actor RandomActions(int action_size);
/// One after the other, of one episode. @param actions a row for each control step; after the last
/// there is no effort.
Actor PlayActions(Eigen::MatrixXf actions);

/// One control step: the state before it and what was done in it.
struct SimulatedStep {
  double time;           ///< [s] since the episode began
  Eigen::VectorXd q, v;  ///< as the sensors read them, which may be late or biased: JointDynamics
  Eigen::VectorXd true_q;
  Eigen::VectorXd action;  ///< of the driven joints, in the task's own units
  double reward;
  bool terminated, truncated;
};

/// How long an episode was, what it earned, and why it ended.
struct EpisodeSummary {
  int64_t steps = 0;
  double sum = 0;  ///< of the rewards
  enum class End { kTimeLimit, kTerminated, kNotFinite, kInterrupted };
  End end = End::kTimeLimit;
};

/// Random numbers with which an episode begins: Environment::Reset's.
Random EpisodeStart(uint64_t seed, uint32_t number);

/// Plays one episode of the environment. Equal seeds and numbers give equal episodes. One thread
/// for each environment.
/// @param see is shown every step, in order. @param stop is asked after every step but the last.
/// @throws std::runtime_error if an action is not finite.
EpisodeSummary PlayEpisode(Environment& environment, const RobotDescription& robot,
                           const Actor& actor, uint64_t seed, uint32_t number,
                           const std::function<void(const SimulatedStep&)>& see,
                           const std::function<bool()>& stop);

}  // namespace plumb
