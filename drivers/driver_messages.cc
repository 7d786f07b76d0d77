// What the driver says: JOINT_STATE and DRIVER_STATUS.

#include <algorithm>
#include <bit>
#include <functional>
#include <limits>

#include "drivers/driver.h"

namespace plumb {
namespace {

constexpr size_t kBins = 20;  // of the lateness histogram, the last one open

}  // namespace

void Driver::PrepareMessages() {
  const size_t size = joints_.size();
  state_message_.sequence = -1;
  state_message_.num_joints = static_cast<int32_t>(size);
  for (auto* values : {&state_message_.position, &state_message_.velocity, &state_message_.effort_measured,
                       &state_message_.effort_sent, &state_message_.effort_applied}) {
    values->resize(size);
  }
  state_message_.valid.resize(size);
  state_message_.measured.resize(size);

  status_.frames_received = status_.frames_sent = status_.frames_rejected = status_.frames_dropped = 0;
  status_.commands_accepted = status_.commands_rejected = status_.commands_expired = 0;
  status_.messages_rejected = status_.cycles = status_.overruns = status_.measurements_lost = 0;
  status_.stopped_by_request = false;
  status_.num_joints = static_cast<int32_t>(size);
  for (const Joint& joint : joints_) status_.joint_name.push_back(joint.name);
  status_.joint_state.resize(size);
  status_.joint_reason.resize(size);
  for (auto* values : {&status_.motor_temperature, &status_.drive_temperature, &status_.bus_voltage}) values->resize(size);
  status_.num_sensors = status_.num_phases = 0;
  status_.frames_foreign = status_.commands_limited = status_.commands_forged = 0;
  status_.commands_signed = false;
  status_.num_bins = kBins;
  status_.lateness.assign(kBins, 0);
}

const joint_state_t* Driver::NextState() noexcept {
  int64_t utime;
  if (!measurements_.Next(utime, scratch_)) return nullptr;
  joint_state_t& message = state_message_;
  message.utime = utime;
  ++message.sequence;
  for (size_t i = 0; i < joints_.size(); ++i) {
    message.measured[i] = utime;
    message.position[i] = scratch_[i].position;
    message.velocity[i] = scratch_[i].velocity;
    message.effort_measured[i] = scratch_[i].effort;
    message.effort_sent[i] = effort_sent_[i];
    message.effort_applied[i] = std::numeric_limits<double>::quiet_NaN();
    message.valid[i] = joints_[i].motor->state() != DriveState::kAbsent;
  }
  if (has_previous_) history_.Average(previous_utime_, utime, message.effort_applied);
  previous_utime_ = utime;
  has_previous_ = true;
  return &message;
}

void Driver::NoteLateness(int64_t lateness) noexcept {
  ++status_.cycles;
  if (lateness >= cycle_) ++status_.overruns;
  const auto bin =
      static_cast<size_t>(std::bit_width(static_cast<uint64_t>(std::max<int64_t>(lateness, 1)))) - 1;
  ++status_.lateness[std::min(bin, kBins - 1)];
}

void Driver::NoteChanges() noexcept {
  const std::hash<std::string_view> hash;
  uint64_t signature = static_cast<uint64_t>(state());
  const auto mix = [&](uint64_t value) { signature = (signature ^ value) * 0x9E3779B97F4A7C15; };
  mix(hash(reason()));
  mix(status_.stopped_by_request);
  mix(link_ == LinkState::kUp && !bus_off_);
  for (const Joint& joint : joints_) {
    mix(static_cast<uint64_t>(joint.motor->state()));
    mix(hash(joint.motor->reason()));
  }
  if (signature != signature_) ++revision_;
  signature_ = signature;
}

const driver_status_t& Driver::Status(int64_t utime, const TransportStats& stats, int64_t messages_rejected) {
  status_.utime = utime;
  status_.state = static_cast<int8_t>(state());
  status_.reason = reason();
  status_.bus_up = link_ == LinkState::kUp && !bus_off_;
  for (size_t i = joints_.size(); i-- > 0;) {
    const Motor& motor = *joints_[i].motor;
    status_.joint_state[i] = static_cast<int8_t>(motor.state());
    status_.joint_reason[i] = motor.reason();
    const MotorReadings readings = motor.readings();
    status_.motor_temperature[i] = readings.motor_temperature;
    status_.drive_temperature[i] = readings.drive_temperature;
    status_.bus_voltage[i] = readings.bus_voltage;
    if (status_.state == driver_status_t::ABSENT && motor.state() == DriveState::kAbsent) {
      status_.reason = joints_[i].name + ": " + status_.joint_reason[i];
    }
  }
  status_.frames_rejected = frames_rejected_ + stats.malformed;
  status_.frames_sent = stats.sent;
  status_.frames_dropped = stats.refused + stats.lost;
  status_.frames_foreign = stats.foreign;
  status_.measurements_lost = measurements_.lost();
  status_.messages_rejected = requests_rejected_ + messages_rejected;
  return status_;
}

}  // namespace plumb
