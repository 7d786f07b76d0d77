#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "plumb/robot_state_t.hpp"
#include "robot/description.h"
#include "sim/simulator.h"

namespace plumb {

/// What the simulator would have made of the robot's state one control period ago, under the
/// efforts that were really applied since: where it differs from the robot, it is wrong. Not
/// thread-safe.
class OneStepPrediction {
 public:
  struct Predicted {
    int64_t utime, sequence;  ///< of the state that was predicted
    Eigen::VectorXd q, v;
    Eigen::VectorXd q_measured;
    std::string Json() const;
  };

  /// With the prior's means as parameters. @throws std::invalid_argument, see Simulator.
  explicit OneStepPrediction(const RobotDescription& robot);

  /// @param physical see Simulator::SetParameters, which may throw.
  void SetParameters(const Eigen::VectorXd& physical) { simulator_.SetParameters(physical); }
  /// The next state. What is not this robot's, or not a number, is passed over.
  void OnState(const robot_state_t& state);
  /// Of the newest state; none if one is missing since that of a control period ago, the estimator
  /// began anew, or an effort is not known.
  std::optional<Predicted> Predict();

 private:
  struct State {
    int64_t utime, sequence;
    Eigen::VectorXd q, v, effort;
    bool restarted;
  };
  Simulator simulator_;
  const int64_t period_;  // [us] of control
  std::vector<EffortSegment> Efforts(size_t from, size_t to) const;

  std::deque<State> states_;  // gapless, of two control periods, the newest last
};

}  // namespace plumb
