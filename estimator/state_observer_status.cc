// Of state_observer.h: ESTIMATOR_STATUS, about the observer and the sensors.

#include <fmt/format.h>

#include <cmath>

#include "common/special_numbers.h"
#include "common/time_units.h"
#include "estimator/state_observer.h"

namespace plumb {
namespace {

using Finding = AgreementWatch::Finding;

constexpr double kSurelyBiased = 4;  // times what its bias may be

std::string OfVelocity(const AgreementWatch& watch, Finding found, const char* rate) {
  switch (found) {
    case Finding::kNone:
      return {};
    case Finding::kLevelStuck:
      return fmt::format("position stuck at {:.4g}, but the {} says that it moved by {:.3g}",
                         watch.level(), rate, -watch.excess());
    case Finding::kRateStuck:
      return fmt::format("{} stuck, but the position moves", rate);
    case Finding::kLevelJumped:
      return fmt::format("position jumped by {:.3g}", watch.jump());
    case Finding::kDisagree:
      return fmt::format("position and {} disagree: by {:.3g}/s", rate,
                         watch.excess() / watch.duration());
  }
  return {};
}

// Here the level is the filter's velocity.
std::string OfAcceleration(const AgreementWatch& watch, Finding found) {
  if (found == Finding::kNone) return {};
  if (found == Finding::kRateStuck) return "acceleration stuck, but the position moves";
  return fmt::format("position and the IMU's acceleration disagree: by {:.3g}/s^2",
                     watch.excess() / watch.duration());
}

}  // namespace

std::string StateObserver::SensorReason(const Joint& joint) const {
  const bool biased = joint.settings.bias_sd > 0 &&
                      std::abs(joint.filter.bias()) > kSurelyBiased * joint.settings.bias_sd;
  std::string reason =
      OfVelocity(joint.velocity_watch, joint.velocity_found, joint.gyro ? "gyro" : "velocity");
  if (reason.empty()) reason = OfAcceleration(joint.acceleration_watch, joint.acceleration_found);
  if (reason.empty() && biased) {
    reason = fmt::format("{} biased by {:.3g}", joint.gyro ? "gyro" : "accelerometer",
                         joint.filter.bias());
  }
  return reason;
}

estimator_status_t StateObserver::Status() const {
  estimator_status_t status{};
  status.utime = state_.utime;
  status.valid = state_.valid;
  status.num_joints = static_cast<int32_t>(joints_.size());
  for (const Joint& joint : joints_) {
    status.joint_name.push_back(joint.name);
    status.age.push_back(joint.used < 0 ? kNaN : Seconds(state_.utime - joint.used));
    status.position_nis.push_back(joint.position_nis.value());
    status.velocity_nis.push_back(joint.velocity_nis.value());
    status.acceleration_nis.push_back(joint.acceleration_nis.value());
    status.bias.push_back(joint.settings.bias_sd > 0 ? joint.filter.bias() : kNaN);
    status.joint_reason.push_back(SensorReason(joint));
    if (status.reason.empty() && joint.out) {
      status.reason =
          joint.of_base ? fmt::format("{}: not known until a foot rests on the ground", joint.name)
          : joint.used < 0
              ? fmt::format("{}: no reading yet", joint.name)
              : fmt::format("{}: no reading for {:.2f} s", joint.name, status.age.back());
    }
  }
  if (status.reason.empty() && !state_.valid) status.reason = "the filter has just started";
  status.measurements = measurements_;
  status.refused = refused_;
  status.duplicates = duplicates_;
  status.reordered = reordered_;
  status.restarts = restarts_;
  status.outages = outages_;
  status.imu_readings = imu_readings_;
  status.imu_refused = imu_refused_;
  status.imu_duplicates = imu_duplicates_;
  status.imu_reordered = imu_reordered_;
  return status;
}

}  // namespace plumb
