#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "estimator/model/unscented_filter.h"
#include "plumb/joint_state_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "robot/description.h"
#include "sim/simulator.h"

namespace plumb {

/// The causal state by an unscented Kalman filter on the simulator's dynamics, for control only:
/// what calibration would learn from it is what it has been told. It stands on a StateObserver,
/// whose state it takes over where its own prediction cannot be had, and which decides what
/// readings are acceptable at all.
///
/// The state is q and v of all joints, as sensors read them, and the biases of gyros. From
/// measurement to measurement it moves as the simulator says, by leapfrog whatever robot.toml's
/// integrator is, under the effort that JOINT_STATE says was applied. Accelerations that the
/// simulator does not know of are white, of spectral density [estimator.model] acceleration,
/// squared, and independent. A new reading of a drive, an encoder, or an IMU's orientation and rate
/// counts at its own time, by the prediction's mean acceleration, with the noise that EstimatorOf
/// says; accelerometers, and an IMU's readings between those of JOINT_STATE, are not used.
///
/// OnJointState does not allocate after the first call. Not thread-safe.
class UnscentedObserver {
 public:
  /// Beyond this many rad, m, rad/s or m/s a prediction has failed.
  static constexpr double kFarthest = 1e6;

  /// @param robot with known parameters, see Model::Describe.
  /// @throws std::invalid_argument if it cannot be simulated, or has a spherical joint, of which no
  /// JOINT_STATE tells.
  explicit UnscentedObserver(const RobotDescription& robot);

  /// @param measured one that the StateObserver has accepted.
  /// @param kinematic the StateObserver's state after it. While that is not valid, or an effort is
  /// not known, it is taken over.
  void OnJointState(const joint_state_t& measured, const robot_state_t& kinematic);

  /// After the last measurement: as the kinematic one, but for q, v, their standard deviations,
  /// model_based, which is always true, and restarted.
  const robot_state_t& state() const { return state_; }
  /// How often a kinematic state was taken over because the filter had failed: the filter was
  /// not finite or out of reach, a covariance not positive definite, or a position further than
  /// reset_after, and five standard deviations, from what was expected.
  int64_t restarts() const { return restarts_; }

 private:
  struct Joint {
    EstimatorSettings settings;
    bool passive;
    Eigen::Index bias = -1;  // of its gyro in the state; -1 = none
    int64_t measured = -1;   // utime of its newest reading
  };

  bool Advance(const joint_state_t& measured, double elapsed);
  bool Predict(double elapsed);
  bool Move(Eigen::Ref<Eigen::VectorXd> state, double elapsed);
  bool UseReading(const joint_state_t& measured, size_t joint);
  void TakeOver(const robot_state_t& kinematic);
  void Remember(double elapsed);

  Simulator simulator_;
  std::vector<Joint> joints_;
  Eigen::Index n_;  // joints
  UnscentedFilter filter_;
  Eigen::MatrixXd noise_;
  Eigen::VectorXd mean_, sd_, row_;
  Eigen::VectorXd effort_, last_effort_, acceleration_;
  std::vector<EffortSegment>
      past_;  // the last efforts, as many as may still be on their way; empty without delays
  robot_state_t state_{};
  bool started_ = false;
  int64_t restarts_ = 0;
};

}  // namespace plumb
