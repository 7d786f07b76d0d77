#include "dashboard/channels.h"

#include <algorithm>

namespace plumb {

std::span<const ChannelOfPage> ChannelsOfPage() {
  static constexpr ChannelOfPage kChannels[] = {
      {"CALIBRATION_STATUS", "calibration_status_t", false, false},
      {"CONTROLLER_STATUS", "controller_status_t", false, true},
      {"DRIVER_REQUEST", "driver_request_t", false, false},
      {"DRIVER_STATUS", "driver_status_t", false, true},
      {"ESTIMATOR_STATUS", "estimator_status_t", false, false},
      {"IMU", "imu_t", true, false},
      {"JOINT_COMMAND", "joint_command_t", true, false},
      {"JOINT_STATE", "joint_state_t", true, false},
      {"PARAMETER_DISTRIBUTION", "parameter_distribution_t", false, false},
      {"PLACE_ROBOT", "place_robot_t", false, false},
      {"POLICY", "policy_t", false, false},
      {"ROBOT_STATE", "robot_state_t", true, true},
      {"ROBOT_STATE_SMOOTHED", "robot_state_t", true, false},
      {"TRAINING_STATUS", "training_status_t", false, true},
  };
  return kChannels;
}

bool IsChannelOfPage(std::string_view name) {
  return std::ranges::find(ChannelsOfPage(), name, &ChannelOfPage::name) != ChannelsOfPage().end();
}

}  // namespace plumb
