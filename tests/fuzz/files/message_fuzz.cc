// libFuzzer: whatever decodes as one of the LCM types encodes to as many bytes, and what is made of
// policies and distributions is finite, or refused.

#include "controller/policy.h"
#include "plumb/calibration_status_t.hpp"
#include "plumb/controller_status_t.hpp"
#include "plumb/driver_request_t.hpp"
#include "plumb/driver_status_t.hpp"
#include "plumb/estimator_status_t.hpp"
#include "plumb/imu_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "plumb/joint_state_t.hpp"
#include "plumb/lockstep_grant_t.hpp"
#include "plumb/lockstep_hello_t.hpp"
#include "plumb/lockstep_report_t.hpp"
#include "plumb/parameter_distribution_t.hpp"
#include "plumb/place_robot_t.hpp"
#include "plumb/policy_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "plumb/training_status_t.hpp"
#include "robot/parameter_distribution.h"
#include "tests/fuzz/files/input_file.h"

namespace plumb {
namespace {

// @return whether it could be decoded. The type's hash is put before it: nobody would guess it.
template <class Message>
bool Decodes(std::span<const uint8_t> body, Message& message) {
  std::vector<uint8_t> bytes(8);
  const int64_t hash = Message::getHash();
  for (size_t i = 0; i < 8; ++i) bytes[i] = static_cast<uint8_t>(hash >> (56 - 8 * i));
  bytes.insert(bytes.end(), body.begin(), body.end());
  const int used = message.decode(bytes.data(), 0, static_cast<int>(bytes.size()));
  if (used < 0) return Refuse("it does not decode"), false;
  Require(used <= static_cast<int>(bytes.size()));
  Require(message.getEncodedSize() == used);
  return true;
}

template <class... Message>
void TryOne(size_t index, std::span<const uint8_t> body) {
  size_t i = 0;
  (
      [&] {
        if (i++ != index) return;
        Message message;
        Decodes(body, message);
      }(),
      ...);
}

void TryPolicy(std::span<const uint8_t> body) {
  policy_t message;
  if (!Decodes(body, message)) return;
  ReadOrRefuse<std::invalid_argument>(
      [&] { Require(GaussianPolicy::FromMessage(message).parameters.allFinite()); });
}

void TryDistribution(std::span<const uint8_t> body) {
  parameter_distribution_t message;
  if (!Decodes(body, message)) return;
  ReadOrRefuse<std::invalid_argument>([&] {
    const ParameterDistribution distribution =
        ParameterDistribution::FromMessage(message, FuzzRobot());
    Random random(1);
    Require(distribution.SampleCoordinates(random).allFinite());
  });
}

}  // namespace
}  // namespace plumb

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  if (size == 0) return 0;
  const size_t kind = data[0] % 16;
  const std::span<const uint8_t> body(data + 1, size - 1);
  if (kind == 14) {
    TryPolicy(body);
  } else if (kind == 15) {
    TryDistribution(body);
  } else {
    TryOne<calibration_status_t, controller_status_t, driver_request_t, driver_status_t,
           estimator_status_t, imu_t, joint_command_t, joint_state_t, lockstep_grant_t,
           lockstep_hello_t, lockstep_report_t, place_robot_t, robot_state_t, training_status_t>(
        kind, body);
  }
  return 0;
}
