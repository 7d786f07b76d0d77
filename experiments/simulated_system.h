#pragma once

#include "experiments/real_system.h"
#include "robot/description.h"
#include "sim/environment.h"

namespace plumb {

/// The "real" robot of the paper: the simulator itself with parameters that nobody is told. Its
/// states are read with independent noise, by the policy and by the recording alike. Not
/// thread-safe.
class SimulatedSystem : public RealSystem {
 public:
  /// @param hidden physical units, order of robot.parameters. @param noise standard deviations of
  /// what is read of (q, v), physical units; zero = exact. @param seed of initial states, noise and
  /// exploration. @throws std::invalid_argument, see Environment.
  SimulatedSystem(const RobotDescription& robot, const Eigen::VectorXd& hidden,
                  const Eigen::VectorXd& noise, uint64_t seed);

  RobotEpisode Run(const GaussianPolicy& policy, bool explore, int steps, uint32_t number) override;

 private:
  Environment environment_;
  Eigen::VectorXd q_sd_, v_sd_;
  double period_, latency_;
  uint64_t seed_;
};

/// Standard deviations of a state as encoders and an observer tell it: positions [rad or m] to a
/// count of a 14-bit encoder, 1.1e-4, velocities [rad/s or m/s] as the observer's smoother has
/// them, 5e-3.
Eigen::VectorXd ReadingNoise(const RobotDescription& robot);

}  // namespace plumb
