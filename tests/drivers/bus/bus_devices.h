#pragma once

#include <string>
#include <vector>

#include "drivers/bus/bus_plan.h"
#include "drivers/protocols/cansimple.h"
#include "drivers/protocols/cia406.h"
#include "drivers/protocols/registry.h"
#include "drivers/protocols/xsens.h"

// Devices for plans of buses.
namespace plumb {

inline BusMessage Message(const Layout& layout, uint32_t id, int64_t period, uint8_t length,
                          int64_t jitter = 0) {
  BusMessage message;
  message.layout = layout;
  message.layout.length = length;
  message.id = id;
  message.period = period;
  message.jitter = jitter;
  if (jitter > 0) message.direction = BusMessage::Direction::kToDevice;
  return message;
}

/// An ODrive with torque setpoints of 4 bytes and without telemetry but its current.
inline BusDevice Drive(int node, int64_t period) {
  using namespace cansimple;
  const auto id = [&](const Layout& layout) {
    return static_cast<uint32_t>(node) << 5 | layout.command;
  };
  return {"drive" + std::to_string(node),
          "cansimple",
          {Message(kHeartbeat, id(kHeartbeat), 100'000, 8),
           Message(kGetEncoderEstimates, id(kGetEncoderEstimates), period, 8),
           Message(kSetInputTorque, id(kSetInputTorque), period, 4, BusMessage::kHostJitter),
           Message(kGetIq, id(kGetIq), 10'000, 8)},
          {}};
}
inline BusDevice Encoder(int node, int64_t period) {
  return {"encoder" + std::to_string(node),
          "cia406",
          {Message(cia406::kPosition, 0x180 + static_cast<uint32_t>(node), period, 4)},
          {}};
}
inline BusDevice Imu(uint32_t base, int64_t period) {
  using namespace xsens;
  return {
      "imu",
      "xsens",
      {Message(kSampleTime, base + 0x05, period, 4), Message(kQuaternion, base + 0x21, period, 8),
       Message(kRateOfTurn, base + 0x32, period, 6),
       Message(kAcceleration, base + 0x34, period, 6)},
      {}};
}
inline std::vector<BusDevice> Leg(int64_t motors, int64_t encoders, int64_t imu,
                                  uint32_t base = 0x380) {
  return {Drive(1, motors),     Drive(2, motors),     Drive(3, motors),
          Encoder(1, encoders), Encoder(2, encoders), Imu(base, imu)};
}

inline double Response(const BusPlan& plan, uint32_t id) {
  for (const BusPlan::Row& row : plan.rows) {
    if (row.message.id == id) return row.response;
  }
  return -1;
}

inline MotorDescription MitMotor(int node, int master) {
  MotorDescription motor;
  motor.protocol = "mit";
  motor.node = node;
  motor.mit = MitDescription{master, {.velocity = 50, .torque = 18}, "a test"};
  return motor;
}

inline MotorDescription RmdMotor(int node) {
  MotorDescription motor;
  motor.protocol = "rmd";
  motor.node = node;
  motor.rmd = RmdDescription{.torque_constant = 1, .current = 10, .source = "a test"};
  return motor;
}

inline MotorDescription Moteus(int node) {
  MotorDescription motor;
  motor.protocol = "moteus";
  motor.node = node;
  motor.moteus = MoteusDescription{.torque = 10};
  return motor;
}

inline std::vector<BusDevice> Motors(std::vector<MotorDescription> motors, double cycle = 0.001) {
  std::vector<BusDevice> devices;
  DriverSettings driver{};
  driver.cycle = driver.measurement = cycle;
  driver.heartbeat_timeout = 0.5;
  for (const MotorDescription& motor : motors) {
    devices.push_back(MotorBusDevice(motor, driver));
    devices.back().name = "motor" + std::to_string(motor.node);
  }
  return devices;
}

}  // namespace plumb
