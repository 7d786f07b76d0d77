#include "estimator/base_observer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "common/special_numbers.h"
#include "common/time_units.h"
#include "estimator/moved_by_hand.h"
#include "robot/rotation_vector.h"
#include "robot/twist_angle.h"

namespace plumb {
namespace {

using Eigen::Vector3d;

constexpr double kLate = 1e-6 * ImuInbox::kLatest;                            // [s]
constexpr double kHeightKnown = 0.1, kTiltKnown = 0.1, kVelocityKnown = 0.5;  // [m], [rad], [m/s]

// [kg] of all that the base carries, and of itself.
double Mass(const RobotDescription& robot) {
  double mass = 0;
  for (const LinkDescription& link : robot.links) mass += link.mass;
  return mass;
}

LegOdometry::Settings SettingsOf(const RobotDescription& robot, const FloatingBase& base) {
  const SensorDescription& imu = robot.sensors[base.imu];
  const auto& contact = robot.simulation.contact;
  return {.rate_sd = imu.noise.velocity_sd,
          .rate_bias_sd = imu.rate_bias_sd,
          .acceleration_sd = imu.acceleration_sd,
          .acceleration_bias_sd = imu.acceleration_bias_sd,
          .period = imu.period,
          .angle_sd = imu.noise.position_sd,
          .ground_sd = robot.estimator.ground_sd,
          .slip = robot.estimator.slip,
          .gravity = robot.simulation.gravity,
          .normal = base.spatial ? std::nullopt : std::optional(base.normal()),
          .give = contact ? Mass(robot) / contact->stiffness : 0,
          .settles_in = contact ? contact->damping / contact->stiffness : 0};
}

// That the smoother has to remember: of the lag, of what may come late, and those around it.
size_t ReadingsIn(const RobotDescription& robot, const FloatingBase& base) {
  const double back = (robot.estimator.lag + 1) * robot.driver.measurement + kLate;
  return static_cast<size_t>(std::ceil(back / robot.sensors[base.imu].period)) + 3;
}

}  // namespace

BaseObserver::BaseObserver(const RobotDescription& robot)
    : base_(FloatingBaseOf(robot)),
      points_(ContactPoints(robot)),
      longest_gap_(robot.estimator.outage),
      reset_after_(robot.estimator.reset_after),
      measured_angle_sd_(robot.sensors[base_.imu].noise.position_sd),
      rate_sd_(robot.sensors[base_.imu].noise.velocity_sd),
      creep_(robot.estimator.creep),
      odometry_(SettingsOf(robot, base_), points_.size()),
      smoother_(points_.size(), ReadingsIn(robot, base_)),
      kinematics_(robot),
      q_(Eigen::VectorXd::Zero(robot.num_positions())),
      v_(Eigen::VectorXd::Zero(robot.num_velocities())),
      jacobian_(Eigen::Matrix3Xd::Zero(3, robot.num_velocities())),
      feet_(points_.size()) {
  for (auto* values : {&legs_.q, &legs_.v, &legs_.q_variance, &legs_.v_variance})
    values->setZero(robot.num_joints());
  for (int i = 0; i < robot.num_joints(); ++i) {
    position_.push_back(robot.position_of(i)), velocity_.push_back(robot.velocity_of(i));
    if (robot.joints[static_cast<size_t>(i)].num_positions() == 4)
      q_[position_.back()] = 1;  // the unit quaternion
  }
  for (size_t i = 0; i < points_.size(); ++i) feet_[i].radius = points_[i].radius;
}

// In the axes of the link that carries the IMU, whose joints are at zero here.
void BaseObserver::LookAtLegs() {
  for (Eigen::Index i = 0; i < legs_.q.size(); ++i) {
    const auto joint = static_cast<size_t>(i);
    if (base_.Has(static_cast<int>(i))) continue;
    q_[position_[joint]] = legs_.q[i];
    v_[velocity_[joint]] = legs_.v[i];
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
    for (Eigen::Index k = 0; k < legs_.q.size(); ++k) {
      if (base_.Has(static_cast<int>(k))) continue;
      const Vector3d lever = to_body * jacobian_.col(velocity_[static_cast<size_t>(k)]);
      foot.centre_variance += legs_.q_variance[k] * lever * lever.transpose();
      foot.velocity_variance += legs_.v_variance[k] * lever * lever.transpose();
    }
  }
}

// Of the velocity: what all feet do alike, neither they nor the IMU tell. The filter does not know
// of it, as it would take it for noise that averages out.
double BaseObserver::CreepSd(const Vector3d& direction) const {
  return creep_ * direction.head<2>().norm();
}

double BaseObserver::AngleOf(const Eigen::Quaterniond& orientation) const {
  return TwistAngle(Eigen::Quaterniond(base_.zero.rotation).conjugate() * orientation, base_.axis);
}

// In a plane its turn about the joint's axis only: a wrong heading does not matter.
Eigen::Quaterniond BaseObserver::Begun(const Eigen::Quaterniond& measured) const {
  if (base_.spatial) return measured.normalized();
  const Eigen::AngleAxisd about(AngleOf(measured), base_.axis);
  return Eigen::Quaterniond(base_.zero.rotation * about);
}

double BaseObserver::TiltSd() const {
  if (!base_.spatial) return odometry_.angle_sd(base_.normal());
  return std::hypot(odometry_.angle_sd(Vector3d::UnitX()), odometry_.angle_sd(Vector3d::UnitY()));
}

bool BaseObserver::Moved(const ImuInbox::Reading& reading) const {
  if (!started_ || !base_.spatial || !reading.orientation_valid) return false;
  const auto& [w, x, y, z] = reading.orientation;
  const Vector3d up = odometry_.orientation().conjugate() * Vector3d::UnitZ(),
                 measured =
                     Eigen::Quaterniond(w, x, y, z).normalized().conjugate() * Vector3d::UnitZ();
  const double apart = std::atan2(up.cross(measured).norm(), up.dot(measured));
  return MovedByHand(apart, reset_after_, std::hypot(TiltSd(), measured_angle_sd_));
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
    using Beginning = LegOdometry::Beginning;
    odometry_.Restart(started_ ? Beginning::kMoves : Beginning::kStands,
                      started_ ? odometry_.position() : base_.zero.position,
                      Begun(Eigen::Quaterniond(w, x, y, z)), feet_);
    if (!started_) angle_ = 0;
    angle_ += std::remainder(AngleOf(odometry_.orientation()) - angle_, 2 * std::numbers::pi);
    started_ = true;
    smoother_.Restart();
    smoother_.Keep(utime_, odometry_);
    return;
  }
  odometry_.Tell(smoother_);
  odometry_.Predict(elapsed, Eigen::Map<const Vector3d>(reading.rate.data()),
                    Eigen::Map<const Vector3d>(reading.force.data()),
                    {.rate = reading.rate_clipped, .force = reading.force_clipped});
  odometry_.Correct(feet_);
  if (!odometry_.finite()) return Restart();
  smoother_.Keep(utime_, odometry_);
  angle_ += std::remainder(AngleOf(odometry_.orientation()) - angle_, 2 * std::numbers::pi);
}

void BaseObserver::Set(int joint, double q, double v, double q_sd, double v_sd,
                       robot_state_t& state) const {
  const auto i = static_cast<size_t>(joint);
  const auto at = static_cast<size_t>(velocity_[i]);
  state.q[static_cast<size_t>(position_[i])] = q;
  state.v[at] = v;
  state.q_sd[at] = q_sd;
  state.v_sd[at] = v_sd;
}

// Of the joint that turns freely; rate and standard deviations about the axes of its link.
void BaseObserver::SetTurn(const Eigen::Quaterniond& orientation, const Vector3d& rate,
                           const Vector3d& angle_sd, const Vector3d& rate_sd,
                           robot_state_t& state) const {
  const auto joint = static_cast<size_t>(base_.turned);
  const Eigen::Quaterniond turn =
      (Eigen::Quaterniond(base_.zero.rotation).conjugate() * orientation).normalized();
  Eigen::Vector4d::Map(&state.q[static_cast<size_t>(position_[joint])]) << turn.w(), turn.x(),
      turn.y(), turn.z();
  const auto at = static_cast<size_t>(velocity_[joint]);
  Vector3d::Map(&state.v[at]) = rate;
  Vector3d::Map(&state.q_sd[at]) = angle_sd;
  Vector3d::Map(&state.v_sd[at]) = rate_sd;
}

void BaseObserver::Fill(int64_t utime, robot_state_t& state) const {
  if (!started_) {
    for (const ImuMounting::Slide& slide : base_.slides)
      Set(slide.joint, kNaN, kNaN, kNaN, kNaN, state);
    const Vector3d none = Vector3d::Constant(kNaN);
    if (base_.spatial)
      SetTurn(Eigen::Quaterniond(kNaN, kNaN, kNaN, kNaN), none, none, none, state);
    else
      Set(base_.turned, kNaN, kNaN, kNaN, kNaN, state);
    return;
  }
  const double ahead = Seconds(utime - utime_);
  for (const ImuMounting::Slide& slide : base_.slides) {
    const Vector3d& along = slide.direction;
    const double velocity = along.dot(odometry_.velocity()),
                 acceleration = along.dot(odometry_.acceleration());
    const double velocity_sd = odometry_.velocity_sd(along);
    // Since the last reading the acceleration may have changed by as much as before it.
    const double change = odometry_.acceleration_change() * ahead;
    Set(slide.joint,
        along.dot(odometry_.position() - base_.zero.position) + ahead * velocity +
            ahead * ahead / 2 * acceleration,
        velocity + ahead * acceleration,
        std::hypot(odometry_.position_sd(along), ahead * velocity_sd, ahead / 2 * change),
        std::hypot(velocity_sd, change, CreepSd(along)), state);
  }
  const Vector3d rates = odometry_.rate();
  if (base_.spatial) {
    const Eigen::Quaterniond& orientation = odometry_.orientation();
    Vector3d angle_sd, rate_sd;
    for (Eigen::Index i = 0; i < 3; ++i) {
      const Vector3d axis = Vector3d::Unit(i);
      rate_sd[i] = std::hypot(odometry_.rate_sd(axis), odometry_.rate_change());
      angle_sd[i] = std::hypot(odometry_.angle_sd(orientation * axis), ahead * rate_sd[i]);
    }
    SetTurn(orientation * FromRotationVector(ahead * rates), rates, angle_sd, rate_sd, state);
    return;
  }
  const double rate = base_.axis.dot(rates);
  const double rate_sd = std::hypot(odometry_.rate_sd(base_.axis), odometry_.rate_change());
  Set(base_.turned, angle_ + ahead * rate, rate,
      std::hypot(odometry_.angle_sd(base_.normal()), ahead * rate_sd), rate_sd, state);
}

void BaseObserver::Smooth(int64_t utime, robot_state_t& state) {
  const LegSmoother::Motion* motion = smoother_.At(utime);
  if (!motion) return;
  const auto sd = [&](Eigen::Index block, const Vector3d& direction) {
    const Eigen::Matrix3d variance = motion->covariance.block<3, 3>(block, block);
    return std::sqrt(std::max(0.0, direction.dot(variance * direction)));
  };
  for (const ImuMounting::Slide& slide : base_.slides) {
    const Vector3d& along = slide.direction;
    Set(slide.joint, along.dot(motion->position - base_.zero.position), along.dot(motion->velocity),
        sd(LegOdometry::kPosition, along),
        std::hypot(sd(LegOdometry::kVelocity, along), motion->acceleration_change, CreepSd(along)),
        state);
  }
  const auto rate_sd = [&](const Vector3d& axis) {
    return std::hypot(rate_sd_, sd(LegOdometry::kRateBias, axis), motion->rate_change);
  };
  if (base_.spatial) {
    Vector3d angle_sds, rate_sds;
    for (Eigen::Index i = 0; i < 3; ++i) {
      angle_sds[i] = sd(LegOdometry::kAngle, motion->orientation * Vector3d::Unit(i));
      rate_sds[i] = rate_sd(Vector3d::Unit(i));
    }
    SetTurn(motion->orientation, motion->rate, angle_sds, rate_sds, state);
    return;
  }
  // Over many turns it is near where it was taken to be.
  const double near = state.q[static_cast<size_t>(position_[static_cast<size_t>(base_.turned)])];
  Set(base_.turned,
      near + std::remainder(AngleOf(motion->orientation) - near, 2 * std::numbers::pi),
      base_.axis.dot(motion->rate), sd(LegOdometry::kAngle, base_.normal()), rate_sd(base_.axis),
      state);
}

bool BaseObserver::valid(int64_t utime) const {
  if (!started_ || Seconds(utime - utime_) > longest_gap_) return false;
  double velocity_sd = 0;
  for (const ImuMounting::Slide& slide : base_.slides)
    velocity_sd = std::hypot(velocity_sd, odometry_.velocity_sd(slide.direction));
  return odometry_.position_sd(Vector3d::UnitZ()) < kHeightKnown && TiltSd() < kTiltKnown &&
         velocity_sd < kVelocityKnown;
}

}  // namespace plumb
