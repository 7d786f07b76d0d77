// Of driver.h: the messages that it publishes: JOINT_STATE and DRIVER_STATUS.

#include <algorithm>
#include <cmath>
#include <functional>

#include "common/special_numbers.h"
#include "drivers/driver/driver.h"
#include "drivers/driver/phase_times.h"

namespace plumb {
void Driver::PrepareMessages() {
  const size_t size = num_joints_;
  state_message_.sequence = -1;
  state_message_.num_joints = static_cast<int32_t>(size);
  for (auto* values :
       {&state_message_.position, &state_message_.velocity, &state_message_.effort_measured,
        &state_message_.effort_sent, &state_message_.effort_applied}) {
    // of joints that nothing measures
    values->assign(size, kNaN);
  }
  state_message_.valid.resize(size);
  state_message_.measured.resize(size);

  status_.commands_accepted = status_.commands_rejected = status_.commands_expired = 0;
  status_.messages_rejected = status_.cycles = status_.overruns = status_.measurements_lost = 0;
  status_.stopped_by_request = false;
  status_.answered = 0;
  status_.num_joints = static_cast<int32_t>(size);
  status_.joint_name = names_;
  status_.joint_state.resize(size);
  status_.joint_reason.resize(size);
  for (size_t i = 0; i < size; ++i) {
    const bool driven =
        std::ranges::any_of(joints_, [&](const Joint& joint) { return joint.index == i; });
    if (driven || std::ranges::any_of(
                      passive_, [&](const Measuring& measuring) { return measuring.joint == i; }))
      continue;
    status_.joint_state[i] = driver_status_t::IDLE;
    status_.joint_reason[i] = "nothing measures it: left to the estimator";
  }
  for (auto* values : {&status_.motor_temperature, &status_.drive_temperature, &status_.bus_voltage,
                       &status_.bus_current}) {
    values->assign(size, kNaN);
  }
  status_.drive_identity.resize(size);
  status_.num_sensors = static_cast<int32_t>(sensors_.size());
  for (const JointSensor& sensor : sensors_) status_.sensor_name.push_back(sensor.name());
  status_.sensor_state.resize(sensors_.size());
  status_.sensor_reason.resize(sensors_.size());
  status_.num_phases = 0;
  status_.commands_limited = status_.commands_forged = 0;
  status_.commands_signed = false;
  status_.num_bins = PhaseTimes::kBins;
  status_.lateness.assign(PhaseTimes::kBins, 0);
}

const joint_state_t* Driver::NextState() noexcept {
  int64_t utime;
  if (!measurements_.Next(utime, scratch_)) return nullptr;
  joint_state_t& message = state_message_;
  message.utime = utime;
  ++message.sequence;
  for (size_t k = 0; k < joints_.size(); ++k) {
    const size_t i = joints_[k].index;
    message.measured[i] = utime;
    message.position[i] = scratch_[k].position;
    message.velocity[i] = scratch_[k].velocity;
    message.effort_measured[i] = scratch_[k].effort;
    message.valid[i] = joints_[k].motor->state() != DriveState::kAbsent;
  }
  for (const Measuring& passive : passive_) {
    const size_t i = passive.joint;
    JointSensor& sensor = sensors_[passive.sensor];
    const JointMeasurement& measurement = sensor.At(utime + measurement_ / 2);
    message.measured[i] = sensor.measured();
    message.position[i] = measurement.position;
    message.velocity[i] = measurement.velocity;
    message.effort_measured[i] = kNaN;
    message.valid[i] = sensor.fresh(now_) && std::isfinite(measurement.position);
  }
  std::ranges::fill(message.effort_applied, kNaN);
  history_.At(utime, message.effort_sent);
  if (has_previous_) history_.Average(previous_utime_, utime, message.effort_applied);
  previous_utime_ = utime;
  has_previous_ = true;
  return &message;
}

const imu_t* Driver::NextImu() noexcept {
  for (JointSensor& sensor : sensors_) {
    if (const imu_t* imu = sensor.NextImu()) return imu;
  }
  return nullptr;
}

void Driver::NoteLateness(int64_t lateness) noexcept {
  ++status_.cycles;
  if (lateness >= cycle_) ++status_.overruns;
  ++status_.lateness[PhaseTimes::Bin(lateness)];
}

void Driver::NoteChanges() noexcept {
  const std::hash<std::string_view> hash;
  uint64_t signature = static_cast<uint64_t>(state());
  const auto mix = [&](uint64_t value) { signature = (signature ^ value) * 0x9E3779B97F4A7C15; };
  mix(hash(reason()));
  mix(status_.stopped_by_request);
  for (const Bus& bus : buses_) mix(bus.usable());
  for (const Joint& joint : joints_) {
    mix(static_cast<uint64_t>(joint.motor->state()));
    mix(hash(joint.motor->reason()));
    mix(Unwatched(joint));
    mix(joint.position_watch.beyond());
  }
  for (const Measuring& passive : passive_) mix(passive.position_watch.beyond());
  for (const JointSensor& sensor : sensors_) {
    mix(static_cast<uint64_t>(sensor.device().state()));
    mix(hash(sensor.device().reason()));
  }
  if (signature != signature_) ++revision_;
  signature_ = signature;
}

driver_status_t& Driver::Status(int64_t utime, std::span<const TransportStats> stats,
                                int64_t messages_rejected) {
  status_.utime = utime;
  status_.state = static_cast<int8_t>(state());
  status_.reason = reason();
  for (size_t i = 0; i < buses_.size(); ++i) {
    const TransportStats counted = i < stats.size() ? stats[i] : TransportStats{};
    bus_status_t& bus = status_.buses[i];
    bus.up = buses_[i].usable();
    bus.frames_received = buses_[i].received;
    bus.frames_sent = counted.sent;
    bus.frames_rejected = buses_[i].rejected + counted.malformed;
    bus.frames_dropped = counted.refused + counted.lost;
    bus.frames_foreign = counted.foreign;
  }
  status_.setpoints_saturated = 0;
  for (size_t k = joints_.size(); k-- > 0;) {
    const Motor& motor = *joints_[k].motor;
    const size_t i = joints_[k].index;
    status_.joint_state[i] = static_cast<int8_t>(motor.state());
    status_.joint_reason[i] = motor.reason();
    if (motor.reason().empty()) status_.joint_reason[i] = Warning(joints_[k]).text();
    const MotorReadings readings = motor.readings();
    status_.motor_temperature[i] = readings.motor_temperature;
    status_.drive_temperature[i] = readings.drive_temperature;
    status_.bus_voltage[i] = readings.bus_voltage;
    status_.bus_current[i] = readings.bus_current;
    status_.drive_identity[i] = motor.identity();
    status_.setpoints_saturated += motor.saturations();
    if (status_.state == driver_status_t::ABSENT && motor.state() == DriveState::kAbsent) {
      Reason absent;
      absent.Set("{}: {}", joints_[k].name, status_.joint_reason[i]);
      status_.reason = absent.text();
    }
  }
  for (size_t k = 0; k < sensors_.size(); ++k) {
    status_.sensor_state[k] = static_cast<int8_t>(sensors_[k].device().state());
    status_.sensor_reason[k] = sensors_[k].Silent(now_).text();
  }
  for (const Measuring& passive : passive_) {
    const bool fresh = sensors_[passive.sensor].fresh(now_);
    status_.joint_state[passive.joint] = fresh ? driver_status_t::IDLE : driver_status_t::ABSENT;
    status_.joint_reason[passive.joint] =
        fresh ? passive.position_watch.Warning().text() : status_.sensor_reason[passive.sensor];
  }
  status_.measurements_lost = measurements_.lost();
  for (const JointSensor& sensor : sensors_) status_.measurements_lost += sensor.lost();
  status_.messages_rejected = requests_rejected_ + messages_rejected;
  return status_;
}

}  // namespace plumb
