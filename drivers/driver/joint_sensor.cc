#include "drivers/driver/joint_sensor.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/special_numbers.h"
#include "common/time_units.h"
#include "drivers/protocols/registry.h"

namespace plumb {
namespace {

Eigen::Map<const Eigen::Vector3d> Vector(const std::array<double, 3>& values) {
  return Eigen::Map<const Eigen::Vector3d>(values.data());
}

}  // namespace

JointSensor::JointSensor(const RobotDescription& robot, const SensorDescription& sensor,
                         int64_t stale_after)
    : name_(sensor.name),
      bus_(sensor.bus),
      stale_after_(std::max(stale_after, 3 * Microseconds(sensor.period))),
      joint_(sensor.joint),
      scale_(sensor.sign * sensor.radius),
      offset_(sensor.offset),
      to_link_(sensor.rotation),
      imu_samples_(Microseconds(sensor.period)),
      samples_(Microseconds(sensor.period)) {
  device_ = MakeSensor(sensor, {.timeout = stale_after_});
  newest_.position = given_.position = kNaN;
  newest_.velocity = given_.velocity = kNaN;
  newest_.effort = given_.effort = kNaN;
  if (sensor.link < 0) return;
  message_.name = sensor.name;
  message_.link = robot.links[static_cast<size_t>(sensor.link)].name;
  mounting_ = MountingOf(robot, sensor.link);
  joint_ = mounting_.turned;
}

SensorUse JointSensor::OnFrame(const Frame& frame, int64_t now, int64_t utime) noexcept {
  const SensorUse use = device_->OnFrame(frame, now);
  if (use != SensorUse::kReading) return use;
  heard_ = true;
  heard_at_ = now;
  if (const EncoderReading* reading = device_->encoder()) Take(OfEncoder(*reading), now, utime);
  if (const ImuSample* sample = device_->imu()) {
    imu_samples_.Add(*sample, utime);
    if (joint_ >= 0 && sample->orientation_valid) Take(OfImu(*sample), now, utime);
  }
  return use;
}

void JointSensor::Take(const JointMeasurement& measurement, int64_t now, int64_t utime) noexcept {
  if (!std::isfinite(measurement.position)) return;
  newest_ = measurement;
  taken_ = true;
  taken_at_ = now;
  samples_.Add(newest_, utime);
}

JointMeasurement JointSensor::OfEncoder(const EncoderReading& reading) const noexcept {
  return {scale_ * reading.position + offset_, scale_ * reading.velocity, kNaN};
}

Eigen::Quaterniond JointSensor::LinkOrientation(const ImuSample& sample) const noexcept {
  const auto& [w, x, y, z] = sample.orientation;
  return Eigen::Quaterniond(w, x, y, z) * Eigen::Quaterniond(to_link_).conjugate();
}

JointMeasurement JointSensor::OfImu(const ImuSample& sample) noexcept {
  const double twist = mounting_.Angle(LinkOrientation(sample));
  // The one of the angles that look like this which is next to the last.
  const double near = std::isfinite(newest_.position) && turns_counted_ ? newest_.position : 0;
  turns_counted_ = true;
  const double rate = mounting_.axis.dot(to_link_ * Vector(sample.rate));
  return {near + std::remainder(twist - near, 2 * std::numbers::pi),
          sample.rate_clipped ? kNaN : rate, kNaN};
}

const JointMeasurement& JointSensor::At(int64_t utime) noexcept {
  samples_.Regularise();
  while (samples_.ready() && samples_.time() <= utime) {
    given_ = samples_.front();
    measured_ = samples_.time();
    samples_.Pop();
  }
  return given_;
}

Reason JointSensor::Silent(int64_t now) const noexcept {
  Reason reason;
  if (device_->state() != SensorState::kRunning) {
    reason.Set("{}", device_->reason());
  } else if (!heard_ || now - heard_at_ > stale_after_) {
    reason.Set("no reading for {} ms", heard_ ? (now - heard_at_) / 1000 : stale_after_ / 1000);
  } else if (joint_ >= 0 && !taken_) {
    reason.Set("it does not trust its orientation yet");
  } else if (joint_ >= 0 && now - taken_at_ > stale_after_) {
    reason.Set("it has not trusted its orientation for {} ms", (now - taken_at_) / 1000);
  }
  return reason;
}

const imu_t* JointSensor::NextImu() noexcept {
  imu_samples_.Regularise();
  if (!imu_samples_.ready()) return nullptr;
  const ImuSample& sample = imu_samples_.front();
  message_.utime = imu_samples_.time();
  Eigen::Map<Eigen::Vector3d>(message_.rate) = to_link_ * Vector(sample.rate);
  Eigen::Map<Eigen::Vector3d>(message_.force) = to_link_ * Vector(sample.force);
  const Eigen::Quaterniond link = LinkOrientation(sample);
  message_.orientation[0] = link.w();
  message_.orientation[1] = link.x();
  message_.orientation[2] = link.y();
  message_.orientation[3] = link.z();
  message_.orientation_valid = sample.orientation_valid;
  message_.rate_clipped = sample.rate_clipped;
  message_.force_clipped = sample.force_clipped;
  imu_samples_.Pop();
  return &message_;
}

int64_t JointSensor::lost() const noexcept {
  return device_->incomplete() + samples_.lost() + imu_samples_.lost();
}

}  // namespace plumb
