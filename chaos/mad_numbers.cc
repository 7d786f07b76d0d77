#include "chaos/mad_numbers.h"

#include <array>
#include <initializer_list>
#include <limits>

#include "common/message_bytes.h"
#include "plumb/controller_status_t.hpp"
#include "plumb/driver_status_t.hpp"
#include "plumb/imu_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "plumb/joint_state_t.hpp"
#include "plumb/parameter_distribution_t.hpp"
#include "plumb/place_robot_t.hpp"
#include "plumb/policy_t.hpp"
#include "plumb/robot_state_t.hpp"

namespace plumb {
namespace {

template <class Number>
Number Mad(Number sane, Random& random) {
  using Limits = std::numeric_limits<Number>;
  const std::array<Number, 9> numbers{Limits::quiet_NaN(),
                                      Limits::infinity(),
                                      -Limits::infinity(),
                                      Limits::max(),
                                      Limits::denorm_min(),
                                      static_cast<Number>(-1e6),
                                      static_cast<Number>(1e6),
                                      static_cast<Number>(1.01) * sane,
                                      -sane};
  return numbers[static_cast<size_t>(random.Uniform() * numbers.size())];
}

int64_t MadInteger(int64_t sane, Random& random) {
  const std::array<int64_t, 6> numbers{std::numeric_limits<int64_t>::min(),
                                       std::numeric_limits<int64_t>::max(),
                                       -1,
                                       0,
                                       sane + 1'000'000,
                                       sane - 1'000'000};
  return numbers[static_cast<size_t>(random.Uniform() * numbers.size())];
}

/// One number of one of the lists.
template <class Number>
void MaddenOne(std::initializer_list<std::vector<Number>*> lists, Random& random) {
  std::vector<Number>& list = **(lists.begin() + static_cast<long>(random.Below(lists.size())));
  if (list.empty()) return;
  Number& number = list[random.Below(list.size())];
  number = Mad(number, random);
}

bool Often(Random& random) { return random.Uniform() < 0.8; }

void Madden(joint_command_t& m, Random& random) {
  if (Often(random)) return MaddenOne({&m.effort}, random);
  if (Often(random)) return MaddenOne({&m.position, &m.velocity, &m.kp, &m.kd}, random);
  m.expiry = MadInteger(m.expiry, random);
}
void Madden(joint_state_t& m, Random& random) {
  if (Often(random)) {
    return MaddenOne(
        {&m.position, &m.velocity, &m.effort_measured, &m.effort_sent, &m.effort_applied}, random);
  }
  m.utime = MadInteger(m.utime, random);
}
void Madden(robot_state_t& m, Random& random) {
  if (Often(random)) return MaddenOne({&m.q, &m.v, &m.q_sd, &m.v_sd, &m.effort}, random);
  m.utime = MadInteger(m.utime, random);
}
void Madden(policy_t& m, Random& random) {
  MaddenOne({&m.weight, &m.observation_mean, &m.observation_scale, &m.action_scale}, random);
}
void Madden(parameter_distribution_t& m, Random& random) {
  MaddenOne({&m.mean, &m.covariance, &m.weight}, random);
}
void Madden(place_robot_t& m, Random& random) { MaddenOne({&m.q, &m.v}, random); }
void Madden(controller_status_t& m, Random& random) {
  MaddenOne({&m.returns, &m.late_rate}, random);
}
void Madden(imu_t& m, Random& random) { m.rate[0] = Mad(m.rate[0], random); }

template <class Message>
std::optional<std::vector<uint8_t>> Changed(std::span<const uint8_t> bytes, Random& random) {
  Message message;
  if (!Decode(bytes, message)) return std::nullopt;
  Madden(message, random);
  return Encode(message);
}

}  // namespace

std::optional<std::vector<uint8_t>> WithMadNumbers(const std::string& channel,
                                                   std::span<const uint8_t> message,
                                                   Random& random) {
  if (channel == "JOINT_COMMAND") return Changed<joint_command_t>(message, random);
  if (channel == "JOINT_STATE") return Changed<joint_state_t>(message, random);
  if (channel.starts_with("ROBOT_STATE")) return Changed<robot_state_t>(message, random);
  if (channel == "POLICY") return Changed<policy_t>(message, random);
  if (channel == "PARAMETER_DISTRIBUTION")
    return Changed<parameter_distribution_t>(message, random);
  if (channel == "PLACE_ROBOT") return Changed<place_robot_t>(message, random);
  if (channel == "CONTROLLER_STATUS") return Changed<controller_status_t>(message, random);
  if (channel == "IMU") return Changed<imu_t>(message, random);
  return std::nullopt;
}

}  // namespace plumb
