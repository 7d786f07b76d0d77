#include "estimator/base_observer.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "common/time_units.h"

namespace plumb {
namespace {

using Eigen::Vector3d;

constexpr double kHeightKnown = 0.1, kTiltKnown = 0.1, kVelocityKnown = 0.5;  // [m], [rad], [m/s]

LegOdometry::Settings SettingsOf(const RobotDescription& robot, const FloatingBase& base) {
  const SensorDescription& imu = robot.sensors[base.imu];
  return {.rate_sd = imu.noise.velocity_sd,
          .rate_bias_sd = imu.rate_bias_sd,
          .acceleration_sd = imu.acceleration_sd,
          .acceleration_bias_sd = imu.acceleration_bias_sd,
          .period = imu.period,
          .angle_sd = imu.noise.position_sd,
          .ground_sd = robot.estimator.ground_sd,
          .slip = robot.estimator.slip,
          .gravity = robot.simulation.gravity,
          .normal = base.normal()};
}

}  // namespace

BaseObserver::BaseObserver(const RobotDescription& robot)
    : base_(FloatingBaseOf(robot)),
      points_(ContactPoints(robot)),
      longest_gap_(robot.estimator.outage),
      odometry_(SettingsOf(robot, base_), points_.size()),
      kinematics_(robot),
      q_(Eigen::VectorXd::Zero(robot.num_joints())),
      v_(q_),
      legs_{q_, q_, q_, q_},
      jacobian_(Eigen::Matrix3Xd::Zero(3, robot.num_joints())),
      feet_(points_.size()) {
  for (size_t i = 0; i < points_.size(); ++i) feet_[i].radius = points_[i].radius;
}

// In the axes of the link that carries the IMU, whose joints are at zero here.
void BaseObserver::LookAtLegs() {
  for (Eigen::Index i = 0; i < q_.size(); ++i) {
    const bool leg = !base_.Has(static_cast<int>(i));
    q_[i] = leg ? legs_.q[i] : 0;
    v_[i] = leg ? legs_.v[i] : 0;
    if (!leg) legs_.q_variance[i] = legs_.v_variance[i] = 0;
  }
  kinematics_.Update(q_, v_);
  const Eigen::Matrix3d to_body = base_.zero.rotation.transpose();
  for (size_t i = 0; i < points_.size(); ++i) {
    const ContactPoint& point = points_[i];
    LegOdometry::Foot& foot = feet_[i];
    foot.centre = to_body * (kinematics_.Position(point.link, point.centre) - base_.zero.position);
    foot.velocity = to_body * kinematics_.Velocity(point.link, point.centre);
    foot.rate = to_body * kinematics_.link(point.link).rate;
    kinematics_.Jacobian(point.link, point.centre, jacobian_);
    foot.centre_variance.setZero();
    foot.velocity_variance.setZero();
    for (Eigen::Index k = 0; k < q_.size(); ++k) {
      const Vector3d lever = to_body * jacobian_.col(k);
      foot.centre_variance += legs_.q_variance[k] * lever * lever.transpose();
      foot.velocity_variance += legs_.v_variance[k] * lever * lever.transpose();
    }
  }
}

double BaseObserver::Angle() const {
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond(base_.zero.rotation).conjugate() * odometry_.orientation();
  return 2 * std::atan2(base_.axis.dot(turn.vec()), turn.w());
}

void BaseObserver::Read(int64_t utime, const ImuInbox::Reading& reading) {
  const double elapsed = Seconds(utime - utime_);
  if (started_ && elapsed <= 0) return;
  const auto& [w, x, y, z] = reading.orientation;
  const bool begin = !started_ || elapsed > longest_gap_ || odometry_.astray();
  if (begin && !reading.orientation_valid) {
    started_ = false;
    return;
  }
  LookAtLegs();
  utime_ = utime;
  if (begin) {
    // Its turn about the joint's axis only: a wrong heading does not matter.
    const Eigen::Quaterniond turn =
        Eigen::Quaterniond(base_.zero.rotation).conjugate() * Eigen::Quaterniond(w, x, y, z);
    const Eigen::AngleAxisd about(2 * std::atan2(base_.axis.dot(turn.vec()), turn.w()), base_.axis);
    using Beginning = LegOdometry::Beginning;
    odometry_.Restart(started_ ? Beginning::kMoves : Beginning::kStands,
                      started_ ? odometry_.position() : base_.zero.position,
                      Eigen::Quaterniond(base_.zero.rotation * about), feet_);
    if (!started_) angle_ = 0;
    angle_ += std::remainder(Angle() - angle_, 2 * std::numbers::pi);
    started_ = true;
    return;
  }
  odometry_.Predict(elapsed, Eigen::Map<const Vector3d>(reading.rate.data()),
                    Eigen::Map<const Vector3d>(reading.force.data()));
  odometry_.Correct(feet_);
  if (!odometry_.finite()) {
    started_ = false;
    return;
  }
  angle_ += std::remainder(Angle() - angle_, 2 * std::numbers::pi);
}

void BaseObserver::Fill(int64_t utime, robot_state_t& state) const {
  const double ahead = Seconds(utime - utime_);
  const auto set = [&](int joint, double q, double v, double q_sd, double v_sd) {
    const auto i = static_cast<size_t>(joint);
    state.q[i] = started_ ? q : std::numeric_limits<double>::quiet_NaN();
    state.v[i] = started_ ? v : state.q[i];
    state.q_sd[i] = started_ ? q_sd : state.q[i];
    state.v_sd[i] = started_ ? v_sd : state.q[i];
  };
  for (const ImuMounting::Slide& slide : base_.slides) {
    const Vector3d& along = slide.direction;
    const double velocity = along.dot(odometry_.velocity()),
                 acceleration = along.dot(odometry_.acceleration());
    const double velocity_sd = odometry_.velocity_sd(along);
    // Since the last reading the acceleration may have changed by as much as before it.
    const double change = odometry_.acceleration_change() * ahead;
    set(slide.joint,
        along.dot(odometry_.position() - base_.zero.position) + ahead * velocity +
            ahead * ahead / 2 * acceleration,
        velocity + ahead * acceleration,
        std::hypot(odometry_.position_sd(along), ahead * velocity_sd, ahead / 2 * change),
        std::hypot(velocity_sd, change));
  }
  const double rate = base_.axis.dot(odometry_.rate());
  const double rate_sd = std::hypot(odometry_.rate_sd(base_.axis), odometry_.rate_change());
  set(base_.turned, angle_ + ahead * rate, rate,
      std::hypot(odometry_.angle_sd(base_.normal()), ahead * rate_sd), rate_sd);
}

bool BaseObserver::valid(int64_t utime) const {
  if (!started_ || Seconds(utime - utime_) > longest_gap_) return false;
  double velocity_sd = 0;
  for (const ImuMounting::Slide& slide : base_.slides)
    velocity_sd = std::hypot(velocity_sd, odometry_.velocity_sd(slide.direction));
  return odometry_.position_sd(Vector3d::UnitZ()) < kHeightKnown &&
         odometry_.angle_sd(base_.normal()) < kTiltKnown && velocity_sd < kVelocityKnown;
}

}  // namespace plumb
