#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "drivers/driver/measurements.h"
#include "drivers/driver/timed_samples.h"
#include "drivers/protocols/sensor.h"
#include "plumb/imu_t.hpp"
#include "robot/description.h"
#include "robot/imu_mounting.h"

namespace plumb {

/// A sensor on the bus and what it says of the robot, in the robot's terms: the position of a
/// joint, how a link turns.
///
/// An encoder measures its joint. An IMU measures how its link turns, and with that the joint that
/// turns it, see ImuMounting: not while it does not trust its orientation, and no rate that is
/// beyond its range.
///
/// No method but the constructor throws or allocates. Not thread-safe. `now` is scaled monotonic,
/// `utime` scaled real time [us].
class JointSensor {
 public:
  /// @param stale_after [us] without a reading after which it counts as silent, but never less than
  /// three periods.
  /// @throws std::invalid_argument for an unknown protocol or settings it cannot have.
  JointSensor(const RobotDescription& robot, const SensorDescription& sensor, int64_t stale_after);

  const std::string& name() const { return name_; }
  size_t bus() const { return bus_; }  ///< index into the robot's buses
  /// Index of the joint that it measures, -1: none.
  int joint() const { return joint_; }
  Sensor& device() { return *device_; }
  /// The next angle of an IMU is the one within half a turn of 0: nobody has counted turns.
  void ForgetTurns() noexcept { turns_counted_ = false; }
  /// The robot may have been put elsewhere at once: what the sensor says is judged anew.
  void Displaced() noexcept {
    device_->Displaced();
    ForgetTurns();
  }
  const Sensor& device() const { return *device_; }

  SensorUse OnFrame(const Frame& frame, int64_t now, int64_t utime) noexcept;

  /// The last measurement of the joint before or at `utime`: effort NaN; velocity NaN if it
  /// reports none. Call it with times that do not decrease.
  const JointMeasurement& At(int64_t utime) noexcept;
  int64_t measured() const noexcept { return measured_; }  ///< utime of what At has given
  /// The newest position, which At may not have given yet.
  const JointMeasurement& newest() const noexcept { return newest_; }
  int64_t taken_at() const noexcept { return taken_at_; }  ///< `now` of that
  /// Whether readings come, of the joint if it measures one, and the newest is not too old.
  bool fresh(int64_t now) const noexcept { return !Silent(now).text().size(); }
  /// Why it is not fresh; empty if it is.
  Reason Silent(int64_t now) const noexcept;

  /// The next reading of an IMU, null if there is none; valid until the next call.
  const imu_t* NextImu() noexcept;

  /// Readings that came in parts, found no room or never came.
  int64_t lost() const noexcept;

 private:
  JointMeasurement OfEncoder(const EncoderReading& reading) const noexcept;
  JointMeasurement OfImu(const ImuSample& sample) noexcept;
  void Take(const JointMeasurement& measurement, int64_t now, int64_t utime) noexcept;
  Eigen::Quaterniond LinkOrientation(const ImuSample& sample) const noexcept;

  std::string name_;
  size_t bus_;
  std::unique_ptr<Sensor> device_;
  int64_t stale_after_;
  int joint_ = -1;
  double scale_ = 1, offset_ = 0;  // of an encoder
  // Of an IMU.
  Eigen::Matrix3d to_link_ = Eigen::Matrix3d::Identity();  // its axes -> the link's
  ImuMounting mounting_;
  TimedSamples<ImuSample> imu_samples_;
  imu_t message_{};

  TimedSamples<JointMeasurement> samples_;
  JointMeasurement given_, newest_;
  int64_t measured_ = 0;
  bool turns_counted_ = false;
  bool heard_ = false, taken_ = false;
  int64_t heard_at_ = 0,
          taken_at_ = 0;  // `now` of the newest reading, and measurement of the joint
};

}  // namespace plumb
