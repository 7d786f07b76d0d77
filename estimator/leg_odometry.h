#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <vector>

#include "estimator/ground_contact.h"
#include "robot/floating_base.h"

namespace plumb {

class LegSmoother;

/// Where a body is that carries an IMU and stands on feet: a contact-aided error-state Kalman
/// filter after M. Bloesch et al., "State Estimation for Legged Robots - Consistent Fusion of Leg
/// Kinematics and IMU", RSS 2012.
///
/// State: position and velocity of the body's origin, its orientation, gyro and accelerometer
/// biases, and the places of the feet that rest. An IMU's reading moves it on; where the legs'
/// kinematics see a resting foot corrects it. Beyond the paper: the ground is the plane z = 0, soft
/// and not quite even (the height of a foot that rests wanders about what the body's weight and
/// acceleration press it in); feet are spheres, which roll; and which of them rest is judged by
/// ContactTest from the filter itself, since nothing feels it.
///
/// The orientation's error is a rotation in the world's axes, which keeps what feet and IMU cannot
/// tell, the heading, to one direction; neither can they tell the horizontal position. Both count
/// from where they began, and their standard deviations grow.
///
/// In a plane what cannot move has no variance, and stays where it is. Does not allocate after
/// construction. Not thread-safe.
class LegOdometry {
 public:
  struct Settings {
    double rate_sd, rate_bias_sd;  ///< [rad/s] of a gyro's reading
    /// [m/s^2] of an accelerometer's, averaged over a period
    double acceleration_sd, acceleration_bias_sd;
    double period;    ///< [s] of the IMU
    double angle_sd;  ///< [rad] of the orientation at the start
    double
        ground_sd;   ///< [m] by which the ground is uneven, and gives way otherwise than by `give`
    double slip;     ///< [m/sqrt(s)] by which a foot that rests creeps
    double gravity;  ///< [m/s^2]
    /// unit vector, in the world: the body stays in the plane across it
    std::optional<Eigen::Vector3d> normal = {};
    /// [m / (m/s^2)] by which a single foot that carries the body is pressed in, for each unit of
    /// the specific force upwards: mass / stiffness of the ground. Feet that rest share it.
    double give = 0;
    double settles_in = 0.05;  ///< [s] in which it is pressed in, or comes back
  };
  /// The legs' measurement of a sphere that can touch the ground, in the body's axes, relative to
  /// the body. Variances without those of the body.
  struct Foot {
    double radius = 0;                                          ///< [m]
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();           ///< [m]
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();         ///< [m/s] of the centre
    Eigen::Vector3d rate = Eigen::Vector3d::Zero();             ///< [rad/s] at which its link turns
    Eigen::Matrix3d centre_variance = Eigen::Matrix3d::Zero();  ///< [m^2]
    Eigen::Matrix3d velocity_variance = Eigen::Matrix3d::Zero();
  };

  /// @param num_feet up to FloatingBase::kMaxPoints.
  LegOdometry(const Settings& settings, size_t num_feet);

  /// The state when it begins: it stands or is about to, within 0.04 m and 0.2 m/s, or, in
  /// the middle of a motion, little: 0.2 m, 3 m/s. Either with the lowest foot on the ground and at
  /// rest on average.
  enum class Beginning { kStands, kMoves };
  /// @param position [m] horizontally; z does not matter. @param orientation body's axes ->
  /// world's. @param feet num_feet.
  void Restart(Beginning beginning, const Eigen::Vector3d& position,
               const Eigen::Quaterniond& orientation, std::span<const Foot> feet);
  struct Clipped {
    bool rate, force;
  };
  /// @param dt [s] > 0 since the last reading. @param rate [rad/s], force [m/s^2], averaged over
  /// them, in the body's axes. @param clipped what may be greater than was read, on its greatest
  /// axis.
  void Predict(double dt, const Eigen::Vector3d& rate, const Eigen::Vector3d& force,
               Clipped clipped = {false, false});
  /// Judges which feet rest, and takes the places of those into account. @param feet at the time of
  /// the last reading.
  void Correct(std::span<const Foot> feet);

  // In the world's axes, but for the rate and the biases.
  const Eigen::Vector3d& position() const { return position_; }
  const Eigen::Vector3d& velocity() const { return velocity_; }
  const Eigen::Quaterniond& orientation() const { return orientation_; }
  Eigen::Vector3d rate() const { return rate_ - rate_bias_; }            ///< of the last reading
  const Eigen::Vector3d& acceleration() const { return acceleration_; }  ///< likewise
  const Eigen::Vector3d& rate_bias() const { return rate_bias_; }
  const Eigen::Vector3d& acceleration_bias() const { return acceleration_bias_; }
  bool rests(size_t foot) const { return feet_[foot].test.touching(); }
  /// A foot that rested was not where it should be: it slipped. Since the start.
  int64_t slips() const { return slips_; }
  /// A foot rests where no ground should be, or is far below it, or the body is held up although no
  /// foot rests: the filter must restart.
  bool astray() const { return astray_; }
  /// Otherwise it must begin as one that stands: nothing of what it knew is left.
  bool finite() const {
    return position_.allFinite() && velocity_.allFinite() && orientation_.coeffs().allFinite() &&
           rate_.allFinite() && acceleration_.allFinite() && rate_bias_.allFinite() &&
           acceleration_bias_.allFinite() && covariance_.allFinite();
  }

  /// Standard deviations along a direction of the world. The orientation's is [rad] about it.
  double position_sd(const Eigen::Vector3d& direction) const { return Sd(kPosition, direction); }
  double velocity_sd(const Eigen::Vector3d& direction) const { return Sd(kVelocity, direction); }
  double angle_sd(const Eigen::Vector3d& direction) const { return Sd(kAngle, direction); }
  /// [rad/s] about a direction of the body.
  double rate_sd(const Eigen::Vector3d& direction) const;
  /// Of the errors of position, velocity and orientation, 3 each: 9 x 9.
  Eigen::Matrix<double, 9, 9> covariance() const { return covariance_.topLeftCorner<9, 9>(); }
  /// [rad/s], [m/s^2] by which rate and acceleration changed from the last but one reading to the
  /// last.
  double rate_change() const { return rate_change_; }
  double acceleration_change() const { return acceleration_change_; }

  /// Where in the error things are: three entries each; from kFeet on the places of the feet.
  static constexpr Eigen::Index kPosition = 0, kVelocity = 3, kAngle = 6, kRateBias = 9,
                                kAccelerationBias = 12, kFeet = 15;
  static constexpr int kMax = int{kFeet} + 3 * FloatingBase::kMaxPoints;
  using Covariance =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMax, kMax>;
  /// Of the whole error.
  const Covariance& whole_covariance() const { return covariance_; }
  /// From now on it is told what is done with each reading. It must outlive this.
  void Tell(LegSmoother& smoother) { smoother_ = &smoother; }

 private:
  struct Rest {
    Eigen::Vector3d place = Eigen::Vector3d::Zero();  // of the centre, if it rests
    ContactTest test;
  };
  static Eigen::Index IndexOf(size_t foot) { return kFeet + 3 * static_cast<Eigen::Index>(foot); }

  double Sd(Eigen::Index block, const Eigen::Vector3d& direction) const;
  Eigen::Vector3d RollingOf(const Foot& foot) const;
  ContactTest::Motion MotionOf(const Foot& foot) const;
  void Judge(size_t index, std::span<const Foot> feet);
  void CompareWithLowest(const Foot& foot, std::span<const Foot> feet,
                         ContactTest::Motion* motion) const;
  void SetDown(size_t index, const Foot& foot);
  void Forget(Eigen::Index block);
  int64_t Resting() const;
  double Pressed() const;
  void Wander(size_t index, const Foot& foot);
  bool CorrectBy(size_t index, const Foot& foot);
  void Shift();

  Settings s_;
  Eigen::Matrix3d allowed_;       // projects velocities into the plane
  Eigen::Matrix3d allowed_turn_;  // and turns onto its normal
  Eigen::Vector3d position_ = Eigen::Vector3d::Zero(), velocity_ = position_,
                  rate_bias_ = position_, acceleration_bias_ = position_;
  Eigen::Quaterniond orientation_ = Eigen::Quaterniond::Identity();
  Eigen::Vector3d rate_ = Eigen::Vector3d::Zero(), acceleration_ = rate_;
  std::optional<Eigen::Vector3d> force_;  // the last reading's, in the world
  double rate_change_ = 0, acceleration_change_ = 0;
  double borne_ = 0;  // [m/s^2] specific force upwards, averaged
  // [s] since a foot rested, [m/s] specific force upwards summed up since then
  double flight_ = 0, lift_ = 0;
  bool lands_ = false;  // no foot rested before this reading
  // [m] by which a single foot that bears all that is felt has pressed the ground in by now
  double pressed_ = 0;
  double dt_ = 0;  // [s] of the last prediction
  std::vector<Rest> feet_;
  // Of bounded size, so that what is computed with them needs no memory but the stack.
  // of the error
  Covariance covariance_;
  // what a correction finds
  Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMax, 1> error_;
  // covariance of what is seen with the error
  Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, kMax> seen_;
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::ColMajor, kMax, 3> gain_;
  int64_t slips_ = 0;
  bool astray_ = false;
  LegSmoother* smoother_ = nullptr;
};

}  // namespace plumb
