#include "estimator/model/unscented_observer.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "common/time_units.h"
#include "estimator/kinematic_filter.h"
#include "estimator/moved_by_hand.h"
#include "estimator/square.h"
#include "robot/motion_noise.h"

namespace plumb {
namespace {

// A JOINT_STATE has one number per joint. A semi-implicit step is of first order: with substeps as
// long as gym's, its error would be greater than the noise.
RobotDescription ForFilter(RobotDescription robot) {
  if (robot.estimator.base == EstimatorSettings::Base::kLegs) {
    throw std::invalid_argument(
        "base = \"legs\": the filter on the simulator's dynamics reads neither feet nor "
        "accelerometer, and nothing else tells where the base is");
  }
  robot.simulation.integrator = SimulationSettings::Integrator::kLeapfrog;
  for (const JointDescription& joint : robot.joints) {
    if (joint.type != JointDescription::Type::kSpherical) continue;
    throw std::invalid_argument("joint " + joint.name +
                                " is spherical: the filter on the simulator's dynamics has none");
  }
  return robot;
}

// A gyro measures its joint's rate and a bias; no joint that slides has a gyro.
bool HasGyroBias(const EstimatorSettings& s) { return s.bias_sd > 0 && !(s.acceleration_sd > 0); }

Eigen::Index StateSize(const RobotDescription& robot) {
  Eigen::Index size = Eigen::Index{2} * robot.num_joints();
  for (int i = 0; i < robot.num_joints(); ++i) size += HasGyroBias(EstimatorOf(robot, i));
  return size;
}

size_t EffortsOnTheirWay(const RobotDescription& robot) {
  double longest = 0;
  for (const JointDescription& joint : robot.joints)
    longest = std::max(longest, joint.dynamics.delay);
  return longest > 0 ? static_cast<size_t>(std::ceil(longest / robot.driver.measurement)) + 1 : 0;
}

}  // namespace

UnscentedObserver::UnscentedObserver(const RobotDescription& robot)
    : simulator_(ForFilter(robot)),
      n_(robot.num_joints()),
      filter_(StateSize(robot)),
      noise_(Eigen::MatrixXd::Zero(filter_.size(), filter_.size())),
      mean_(Eigen::VectorXd::Zero(filter_.size())),
      sd_(mean_),
      row_(mean_),
      effort_(Eigen::VectorXd::Zero(n_)),
      last_effort_(effort_),
      acceleration_(effort_),
      past_(EffortsOnTheirWay(robot), {0, effort_}) {
  Eigen::Index bias = 2 * n_;
  for (int i = 0; i < robot.num_joints(); ++i) {
    Joint joint{EstimatorOf(robot, i), robot.joints[static_cast<size_t>(i)].passive};
    if (HasGyroBias(joint.settings)) {
      joint.bias = bias++;
      sd_(joint.bias) = joint.settings.bias_sd;
    }
    joints_.push_back(joint);
  }
  filter_.Restart(mean_, sd_);
}

bool UnscentedObserver::Move(Eigen::Ref<Eigen::VectorXd> state, double elapsed) {
  simulator_.SetReading(state.head(n_), state.segment(n_, n_), last_effort_);
  if (!past_.empty()) simulator_.Recall(past_);
  simulator_.Step(effort_, elapsed);
  const auto [q, v] = simulator_.Reading();
  const bool within_reach =
      (q.array().abs() <= kFarthest).all() && (v.array().abs() <= kFarthest).all();  // and a number
  if (!simulator_.finite() || !within_reach) return false;
  state.head(n_) = q;
  state.segment(n_, n_) = v;
  return true;
}

bool UnscentedObserver::Predict(double elapsed) {
  const double density = Square(joints_.front().settings.model_acceleration);
  for (Eigen::Index i = 0; i < n_; ++i) {  // integral of white acceleration
    noise_(i, i) = density * elapsed * elapsed * elapsed / 3;
    noise_(i, n_ + i) = noise_(n_ + i, i) = density * elapsed * elapsed / 2;
    noise_(n_ + i, n_ + i) = density * elapsed;
    const Joint& joint = joints_[static_cast<size_t>(i)];
    if (joint.bias < 0) continue;
    noise_(joint.bias, joint.bias) =
        Square(joint.settings.bias_sd) * elapsed / KinematicFilter::kBiasWanders;
  }
  acceleration_ = -filter_.mean().segment(n_, n_) / elapsed;
  const bool predicted = filter_.Predict(
      [this, elapsed](const Eigen::Ref<Eigen::VectorXd>& x) { return Move(x, elapsed); }, noise_);
  acceleration_ += filter_.mean().segment(n_, n_) / elapsed;
  return predicted;
}

bool UnscentedObserver::UseReading(const joint_state_t& measured, size_t i) {
  const Joint& joint = joints_[i];
  const EstimatorSettings& s = joint.settings;
  const auto q = static_cast<Eigen::Index>(i), v = n_ + q;
  const double age = Seconds(measured.utime - measured.measured[i]) + s.delay, span = std::abs(age);
  const double density = Square(s.model_acceleration);  // what it may have done since the reading
  row_.setZero();
  row_(q) = 1;
  row_(v) = -age;
  const double position = measured.position[i] - acceleration_(q) * age * age / 2;
  const double position_variance = Square(s.position_sd) + Square(filter_.mean()(v) * s.timing_sd) +
                                   density * span * span * span / 3;
  const auto [innovation, variance] = filter_.Expect(row_, position, position_variance);
  if (MovedByHand(innovation, s.reset_after, std::sqrt(variance))) return false;
  filter_.Correct(row_, position, position_variance);
  if (!std::isfinite(measured.velocity[i])) return true;
  row_.setZero();
  row_(v) = 1;
  if (joint.bias >= 0) row_(joint.bias) = 1;
  filter_.Correct(row_, measured.velocity[i] + acceleration_(q) * age,
                  Square(s.velocity_sd) + density * span);
  return true;
}

bool UnscentedObserver::Advance(const joint_state_t& measured, double elapsed) {
  if (!Predict(elapsed)) return false;
  for (size_t i = 0; i < joints_.size(); ++i) {
    const bool fresh = measured.valid[i] && measured.measured[i] != joints_[i].measured;
    if (fresh && !UseReading(measured, i)) return false;
  }
  return filter_.mean().allFinite() && filter_.covariance().allFinite() &&
         filter_.covariance().diagonal().minCoeff() >= 0;
}

// Of the biases it keeps what it knows.
void UnscentedObserver::TakeOver(const robot_state_t& kinematic) {
  mean_ = filter_.mean();
  sd_ = filter_.covariance().diagonal().cwiseMax(0).cwiseSqrt();
  for (const Joint& joint : joints_) {
    if (joint.bias < 0 || (std::isfinite(mean_(joint.bias)) && std::isfinite(sd_(joint.bias))))
      continue;
    mean_(joint.bias) = 0;
    sd_(joint.bias) = joint.settings.bias_sd;
  }
  for (Eigen::Index i = 0; i < n_; ++i) {
    const auto joint = static_cast<size_t>(i);
    mean_(i) = kinematic.q[joint];
    mean_(n_ + i) = kinematic.v[joint];
    sd_(i) = kinematic.q_sd[joint];
    sd_(n_ + i) = kinematic.v_sd[joint];
  }
  filter_.Restart(mean_, sd_);
}

void UnscentedObserver::Remember(double elapsed) {
  last_effort_ = effort_.array().isFinite().select(effort_, last_effort_);
  if (past_.empty()) return;
  std::rotate(past_.begin(), past_.begin() + 1, past_.end());
  past_.back().duration = std::max(0.0, elapsed);
  past_.back().effort = last_effort_;
}

void UnscentedObserver::OnJointState(const joint_state_t& measured,
                                     const robot_state_t& kinematic) {
  const double elapsed = started_ ? Seconds(measured.utime - state_.utime) : 0;
  for (Eigen::Index i = 0; i < n_; ++i) {
    const auto joint = static_cast<size_t>(i);
    effort_(i) = joints_[joint].passive ? 0 : measured.effort_applied[joint];
  }
  const bool follows = state_.valid && kinematic.valid && elapsed > 0 && effort_.allFinite();
  const bool failed = follows && !Advance(measured, elapsed);
  state_ = kinematic;
  state_.model_based = true;
  if (failed) {
    ++restarts_;
    state_.restarted = true;
  }
  if (failed || !follows) TakeOver(kinematic);
  Remember(elapsed);
  for (size_t i = 0; i < joints_.size(); ++i) joints_[i].measured = measured.measured[i];
  for (Eigen::Index i = 0; i < n_; ++i) {
    const auto joint = static_cast<size_t>(i);
    state_.q[joint] = filter_.mean()(i);
    state_.v[joint] = filter_.mean()(n_ + i);
    state_.q_sd[joint] = std::sqrt(filter_.covariance()(i, i));
    state_.v_sd[joint] = std::sqrt(filter_.covariance()(n_ + i, n_ + i));
  }
  started_ = true;
}

}  // namespace plumb
