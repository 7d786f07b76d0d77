#include "estimator/state_observer.h"

#include <algorithm>
#include <cmath>

#include "estimator/impact.h"
#include "estimator/square.h"
#include "robot/motion_noise.h"
#include "robot/physical.h"

namespace plumb {
namespace {

// [us]; beyond it nothing is known of the motion in between
constexpr int64_t kLongestGap = 1'000'000;
// [us] of a joint's reading before the others; a sensor's may be half a measurement period ahead
constexpr int64_t kMostAhead = 10'000;
// [s] of a drive's velocity estimate: twice that of an ODrive as it comes
constexpr double kVelocityLag = 4e-3;
constexpr double kBiasesInOrder = 5;     // times its sd
constexpr double kRoundedEffort = 1e-9;  // [Nm] or [N]: what rounding makes of a mean

AgreementWatch::Settings VelocityWatch(const EstimatorSettings& s, bool gyro) {
  return {s.position_sd, s.velocity_sd, gyro ? kBiasesInOrder * s.bias_sd : 0,
          gyro ? 0 : kVelocityLag};
}

// The level is the filter's velocity, which is a good deal better than the velocity that is
// measured.
AgreementWatch::Settings AccelerationWatch(const EstimatorSettings& s) {
  return {0.05, s.acceleration_sd, kBiasesInOrder * s.bias_sd, 0};
}

}  // namespace

StateObserver::StateObserver(const RobotDescription& robot)
    : space_(robot),
      lag_(robot.estimator.lag),
      gravity_(robot.simulation.gravity),
      greatest_effort_(GreatestEffort(robot)),
      most_ahead_(std::max(kMostAhead, Microseconds(robot.driver.measurement / 2))),
      unknown_step_(2 * robot.effort_limits().maxCoeff()),
      contact_(robot) {
  if (robot.estimator.base == EstimatorSettings::Base::kLegs) base_.emplace(robot);
  for (const SensorDescription& sensor : robot.sensors) {
    if (sensor.link < 0) continue;
    const double delay =
        std::isnan(sensor.noise.delay) ? robot.estimator.delay : sensor.noise.delay;
    imus_.push_back(
        {sensor.name, MountingOf(robot, sensor.link), sensor.period, delay, {}, -1, false});
    imus_.back().of_base = base_ && sensor.name == robot.sensors[base_->base().imu].name;
  }
  for (int i = 0; i < robot.num_joints(); ++i) {
    const EstimatorSettings settings = EstimatorOf(robot, i);
    const auto turns = [&](const Imu& imu) { return imu.mounting.turned == i; };
    const bool gyro = std::any_of(imus_.begin(), imus_.end(), turns);
    Joint joint{.name = robot.joints[static_cast<size_t>(i)].name,
                .settings = settings,
                .lower = robot.joints[static_cast<size_t>(i)].lower,
                .upper = robot.joints[static_cast<size_t>(i)].upper,
                .filter = KinematicFilter(settings),
                .position = static_cast<size_t>(robot.position_of(i)),
                .velocity = static_cast<size_t>(robot.velocity_of(i)),
                .velocity_watch = AgreementWatch(VelocityWatch(settings, gyro)),
                .acceleration_watch = AgreementWatch(AccelerationWatch(settings))};
    joint.of_base = base_ && base_->base().Has(i);
    joint.gyro = gyro;
    joints_.push_back(std::move(joint));
  }
  state_.num_positions = robot.num_positions();
  state_.num_velocities = robot.num_velocities();
  state_.q.resize(static_cast<size_t>(state_.num_positions), 0);
  for (auto* values : {&state_.v, &state_.q_sd, &state_.v_sd, &state_.effort})
    values->resize(static_cast<size_t>(state_.num_velocities), 0);
  state_.num_contacts = contact_.num_points();
  state_.contact.assign(static_cast<size_t>(state_.num_contacts), -1);
  waiting_.assign(static_cast<size_t>(lag_) + 2, state_);
  ready_.assign(static_cast<size_t>(lag_) + 2, state_);
}

double StateObserver::Age(const joint_state_t& measured, size_t joint) const {
  return Seconds(measured.utime - measured.measured[joint]) + joints_[joint].settings.delay;
}

bool StateObserver::IsNew(const joint_state_t& measured, size_t joint) const {
  return !joints_[joint].of_base && measured.valid[joint] &&
         measured.measured[joint] != joints_[joint].measured;
}

StateObserver::Use StateObserver::Judge(const joint_state_t& measured) const {
  // Times of this epoch only, so that differences cannot overflow.
  if (static_cast<size_t>(measured.num_joints) != joints_.size() || measured.utime < 0 ||
      !IsTime(measured.utime))
    return Use::kRefuse;
  for (size_t i = 0; i < joints_.size(); ++i) {
    const auto within = [](double x, double greatest) { return !(std::abs(x) > greatest); };
    // NaN: not known.
    if (!within(measured.velocity[i], kGreatestQuantity) ||
        !within(measured.effort_applied[i], greatest_effort_) ||
        !within(measured.effort_sent[i], greatest_effort_))
      return Use::kRefuse;
    const int64_t t = measured.measured[i];
    if (!IsTime(t)) return Use::kRefuse;
    if (!measured.valid[i]) continue;
    const bool of_that_time =
        t >= 0 && t - measured.utime <= most_ahead_ && measured.utime - t <= kLongestGap;
    if (!of_that_time || !IsPhysical(measured.position[i])) return Use::kRefuse;
  }
  if (!started_) return Use::kUse;
  if (measured.utime == state_.utime) return Use::kDuplicate;
  // A driver counts on when its clock is set back; what comes late has an earlier number.
  const bool late = measured.utime < state_.utime && state_.utime - measured.utime <= kLongestGap &&
                    measured.sequence < state_.sequence;
  return late ? Use::kReordered : Use::kUse;
}

// By how much the joints' efforts have stepped. From e0 to e1 after a share of the interval, its
// mean is share e0 + (1 - share) e1. What is not explained by one step to the effort that was sent
// last counts as a step to the mean at the beginning.
// @return the share after which the largest one has.
double StateObserver::FindEffortSteps(const joint_state_t& measured) {
  double largest = 0, largest_after = 0;
  for (size_t i = 0; i < joints_.size(); ++i) {
    Joint& joint = joints_[i];
    const double mean = measured.effort_applied[i], sent = measured.effort_sent[i];
    joint.effort_step = std::isfinite(mean) ? mean - joint.effort : unknown_step_;
    double after = 0;
    if (std::isfinite(mean)) {
      const double share = (sent - mean) / (sent - joint.effort);
      const bool once = std::abs(joint.effort_step) > kRoundedEffort && share > 0 && share < 1;
      if (once) joint.effort_step = sent - joint.effort, after = share;
      joint.effort = once ? sent : mean;
    }
    if (std::abs(joint.effort_step) > largest)
      largest = std::abs(joint.effort_step), largest_after = after;
  }
  return largest_after;
}

void StateObserver::Predict(const joint_state_t& measured, double elapsed) {
  const double after = FindEffortSteps(measured);
  // An effort on one joint may step every joint's acceleration: its own most of all, others' by
  // their coupling.
  const double left = std::exp(-elapsed / kImpactFades);  // of earlier impacts
  double efforts = 0, stops = 0;                          // sums of squares
  for (size_t i = 0; i < joints_.size(); ++i) {
    Joint& joint = joints_[i];
    const double stop = joint.of_base
                            ? 0
                            : StopSpeed(joint.lower, joint.upper, state_.q[joint.position],
                                        state_.v[joint.velocity], elapsed);
    joint.stop = std::max(joint.stop * left, stop);
    efforts += Square(joint.effort_step);
    stops += Square(joint.stop);
  }
  ground_ = std::max(ground_ * left, contact_.ImpactSpeed(elapsed));
  for (Joint& joint : joints_) {
    const double share = Square(joint.settings.coupling);
    const auto felt = [&](double own, double all) {
      return std::sqrt(share * all + (1 - share) * Square(own));
    };
    joint.filter.Predict(elapsed, felt(joint.effort_step, efforts),
                         {ground_, felt(joint.stop, stops)}, after);
  }
}

KinematicFilter::Innovation StateObserver::Correct(Joint& joint, Quantity quantity, double value,
                                                   double age) {
  const KinematicFilter::Innovation innovation = joint.filter.Correct(quantity, value, age);
  if (since_restart_ < kSettled || quantity == Quantity::kAcceleration) return innovation;
  joint.deviance += innovation.nis() + std::log(innovation.variance);
  ++joint.readings;
  return innovation;
}

void StateObserver::UseReading(const joint_state_t& measured, size_t i) {
  Joint& joint = joints_[i];
  const double age = Age(measured, i), position = measured.position[i],
               velocity = measured.velocity[i];
  const double elapsed = joint.used < 0 ? 0 : Seconds(measured.measured[i] - joint.used);
  joint.position_nis.Add(Correct(joint, Quantity::kPosition, position, age).nis(),
                         std::max(0.0, elapsed));
  if (std::isfinite(velocity)) {
    const Quantity quantity = joint.gyro ? Quantity::kRate : Quantity::kVelocity;
    joint.velocity_nis.Add(Correct(joint, quantity, velocity, age).nis(), std::max(0.0, elapsed));
    joint.velocity_watch.Add(position, velocity,
                             elapsed > 0 ? elapsed : 2 * AgreementWatch::kLongestGap);
    if (joint.velocity_watch.finding() != joint.velocity_found) {
      joint.velocity_found = joint.velocity_watch.finding();
      ++reasons_changed_;
    }
  }
  joint.used = measured.measured[i];
}

void StateObserver::JudgeOutages(int64_t utime) {
  for (Joint& joint : joints_) {
    const bool out =
        joint.of_base ? !base_->valid(utime)
                      : joint.used < 0 || utime - joint.used > Microseconds(joint.settings.outage);
    if (out == joint.out) continue;
    joint.out = out;
    if (out && joint.used >= 0) ++outages_;
    ++reasons_changed_;
  }
}

bool StateObserver::OnJointState(const joint_state_t& measured) {
  num_ready_ = 0;
  switch (Judge(measured)) {
    case Use::kUse:
      break;
    case Use::kRefuse:
      ++refused_;
      return false;
    case Use::kDuplicate:
      ++duplicates_;
      return false;
    case Use::kReordered:
      ++reordered_;
      return false;
  }
  const int64_t elapsed = measured.utime - state_.utime;
  const bool jumped = started_ && (elapsed <= 0 || elapsed > kLongestGap);
  bool anew = !started_ || jumped || Placed(measured), back = false;
  if (!anew) {
    Predict(measured, Seconds(elapsed));
    anew = Displaced(measured);
    back = Back(measured);
  }
  if (jumped) {
    for (Imu& imu : imus_) imu.inbox.Clear();
    for (Imu& imu : imus_) imu.used = -1;
    for (Joint& joint : joints_) joint.used = -1;
  }
  bool restarted = anew || back;
  if (anew) {
    RestartAll(measured);
  } else if (back) {
    RestartJoints(measured);
  } else {
    ++since_restart_;
    for (size_t i = 0; i < joints_.size(); ++i) {
      if (IsNew(measured, i)) UseReading(measured, i);
    }
  }
  bool moved = false;
  for (Imu& imu : imus_) {
    while (const ImuInbox::Reading* reading = imu.inbox.Take(measured.utime)) {
      const bool used = !restarted || (back && imu.of_base);  // a base goes on as it is
      if (used) moved = UseImu(imu, *reading, measured) || moved;
    }
  }
  const auto sound = [](const Joint& joint) { return joint.filter.sound(); };
  if (!anew && (moved || !std::all_of(joints_.begin(), joints_.end(), sound))) {
    RestartAll(measured);
    restarted = true;
  }
  for (size_t i = 0; i < joints_.size(); ++i) {
    joints_[i].measured = measured.measured[i];
    if (!restarted) joints_[i].filter.Keep();
  }
  JudgeOutages(measured.utime);
  ++measurements_;
  FillState(measured, restarted);
  return true;
}

}  // namespace plumb
