// Of state_observer.h: IMU readings.

#include <algorithm>
#include <cmath>

#include "estimator/state_observer.h"

namespace plumb {
namespace {

constexpr double kSamePeriod = 0.2;  // of an IMU's

}  // namespace

void StateObserver::OnImu(const imu_t& message) {
  for (Imu& imu : imus_) {
    if (imu.name != message.name) continue;
    switch (imu.inbox.Put(message, started_ ? state_.utime : 0)) {
      case ImuInbox::Verdict::kTaken:
        return;
      case ImuInbox::Verdict::kReordered:
        ++imu_reordered_;
        return;
      case ImuInbox::Verdict::kDuplicate:
        ++imu_duplicates_;
        return;
      case ImuInbox::Verdict::kRefused:
        ++imu_refused_;
        return;
    }
  }
  ++imu_refused_;
}

// @return whether somebody has moved the robot.
bool StateObserver::UseForBase(const ImuInbox::Reading& reading, int64_t utime, int64_t delay) {
  BaseObserver::Legs& legs = base_->legs();
  const int64_t measured = reading.utime - delay;
  const double age = Seconds(utime - measured);
  for (size_t i = 0; i < joints_.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    const KinematicState& mean = joints_[i].filter.mean();
    legs.q[at] = mean(0) - age * mean(1) + age * age / 2 * mean(2);
    legs.v[at] = mean(1) - age * mean(2);
    legs.q_variance[at] = joints_[i].filter.covariance()(0, 0);
    legs.v_variance[at] = joints_[i].filter.covariance()(1, 1);
  }
  if (base_->Moved(reading)) return true;
  base_->Read(measured, reading);
  return false;
}

// @return whether somebody has moved the robot.
bool StateObserver::UseImu(Imu& imu, const ImuInbox::Reading& reading,
                           const joint_state_t& measured) {
  const int64_t late = measured.utime - reading.utime;
  if (late > ImuInbox::kLatest) {
    ++imu_refused_;
    return false;
  }
  ++imu_readings_;
  const double age = Seconds(late) + imu.delay;
  const double elapsed = imu.used < 0 ? 0 : Seconds(reading.utime - imu.used);
  imu.used = std::max(imu.used, reading.utime);
  if (imu.of_base) return UseForBase(reading, measured.utime, Microseconds(imu.delay));
  if (imu.mounting.turned >= 0 && !reading.rate_clipped) {
    // JOINT_STATE has the last reading of each of its periods; those in between, only we have.
    const auto turned = static_cast<size_t>(imu.mounting.turned);
    Joint& joint = joints_[turned];
    const int64_t apart = Microseconds(imu.period / 2);
    if (joint.measured + apart < reading.utime &&
        reading.utime < measured.measured[turned] - apart) {
      Correct(joint, Quantity::kRate,
              imu.mounting.axis.dot(Eigen::Map<const Eigen::Vector3d>(reading.rate.data())), age);
    }
  }
  if (imu.mounting.slides.empty() || !reading.orientation_valid || reading.force_clipped)
    return false;
  const auto& [w, x, y, z] = reading.orientation;
  // As the joints have it: neither a wrong heading nor a boom's roll matter.
  const Eigen::Quaterniond turn =
      imu.mounting.turned < 0
          ? imu.mounting.unturned
          : imu.mounting.unturned *
                Eigen::Quaterniond(Eigen::AngleAxisd(
                    imu.mounting.Angle(Eigen::Quaterniond(w, x, y, z)), imu.mounting.axis));
  const Eigen::Vector3d acceleration =
      turn * Eigen::Map<const Eigen::Vector3d>(reading.force.data()) -
      gravity_ * Eigen::Vector3d::UnitZ();
  for (const ImuMounting::Slide& slide : imu.mounting.slides) {
    Joint& joint = joints_[static_cast<size_t>(slide.joint)];
    const double along = slide.direction.dot(acceleration);
    // The mean since the last reading, or, if one is missing, since a moment of which nothing is
    // kept.
    const double window = joint.filter.since_mark() - age;
    if (std::abs(window - imu.period) < kSamePeriod * imu.period) {
      joint.acceleration_nis.Add(Correct(joint, Quantity::kAcceleration, along, age).nis(),
                                 std::max(0.0, elapsed));
    }
    joint.filter.Mark(age);
    joint.acceleration_watch.Add(joint.filter.mean()(1), along,
                                 elapsed > 0 ? elapsed : 2 * AgreementWatch::kLongestGap);
    if (joint.acceleration_watch.finding() != joint.acceleration_found) {
      joint.acceleration_found = joint.acceleration_watch.finding();
      ++reasons_changed_;
    }
  }
  return false;
}

}  // namespace plumb
