#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "controller/controller.h"
#include "experiments/real_system.h"
#include "robot/description.h"

namespace plumb {

/// The fast loop round a virtual robot, in virtual time: its drives and sensors, their frames, the
/// driver, the observer, the controller and the joiner of transitions, the classes that the
/// processes are made of. Each episode begins with switching everything on and is a function of the
/// policy, the seed and the episode's number: the same bits every time. Not thread-safe.
class BusRobot : public RealSystem {
 public:
  /// @param truth the robot that is there. A frame takes its [estimator] delay to the driver, and
  /// [driver] effort_delay back.
  /// @param model what driver, observer and controller believe of it.
  /// @param hidden the true parameters, order of truth.parameters, physical units.
  BusRobot(RobotDescription truth, RobotDescription model, Eigen::VectorXd hidden, uint64_t seed);

  /// The robot is armed and placed where the model's task begins an episode. The policy is told the
  /// causal state; the roll-out has the smoothed ones. The episode ends by the task's termination,
  /// after `steps` or the task's own time limit, or because the controller or the driver stops it:
  /// see stopped().
  /// @param number < 2^22: each has its own time, and seconds have to stay exact.
  /// @throws std::invalid_argument if the policy is not of this robot, or the robot cannot be
  /// simulated.
  /// @throws std::runtime_error if the robot cannot be armed or placed.
  RobotEpisode Run(const GaussianPolicy& policy, bool explore, int steps, uint32_t number) override;

  /// A whole episode in which `decide` does what a policy would, without a roll-out: for training
  /// on the robot itself. What it throws ends the episode and is thrown again.
  RobotEpisode Play(const Controller::Decide& decide, uint32_t number);

  /// Why the last episode did not come to its own end; empty if it did.
  const std::string& stopped() const { return stopped_; }

 private:
  RobotEpisode Episode(const policy_t& policy, const Controller::Decide& decide, int steps);

  RobotDescription truth_, model_;
  Eigen::VectorXd hidden_;
  uint64_t seed_;
  std::string stopped_;
};

}  // namespace plumb
