#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "drivers/protocols/bus_device.h"
#include "robot/description.h"

namespace plumb {

/// Whether all messages of a bus get through in time, whatever they say.
///
/// Response times by the exact analysis of Davis, Burns, Bril and Lukkien, "Controller Area Network
/// (CAN) schedulability analysis: Refuted, revisited and revised", Real-Time Systems 35 (2007): a
/// message waits for the longest lower one, which has just begun, and for all higher ones, queued
/// at the worst instants. It assumes that of the frames that wait at a node the highest goes first
/// (send in the order of ids), and no errors. Every message must be on the bus before the next of
/// its kind: deadlines are periods; of those that the driver asks for in turn (BusMessage::polled),
/// before the next question, so that one of them waits at a time. Messages without a period block
/// others once but are no load: the plan is that of a robot that moves.
struct BusPlan {
  static constexpr double kWarnLoad = 0.8;

  struct Row {
    std::string device;
    BusMessage message;
    int nominal_bits, worst_bits;  ///< of either rate
    /// [us] that it takes, without stuff bits and with the most
    double nominal_time, worst_time;
    double worst_load;  ///< share of the bus; 0 without a period
    /// [us] from being due to having been sent, at worst; NaN without a period, else maybe infinite
    double response;
    double deadline;  ///< [us] after which it is too late
  };
  double bit_rate;                  ///< [bit/s]
  double data_bit_rate;             ///< [bit/s] of the data of CAN FD frames; 0 = it carries none
  std::vector<Row> rows;            ///< highest priority first
  double nominal_load = 0;          ///< share of the bus without stuff bits
  double worst_load = 0;            ///< with the most there can be
  std::vector<std::string> errors;  ///< why it cannot work, a sentence each
  std::vector<std::string> warnings;
};

/// @param devices as their protocols declare them, named.
/// @param bit_rate [bit/s] > 0
/// @param data_bit_rate [bit/s] of the data of CAN FD frames; 0 = the bus carries none.
BusPlan PlanBus(const std::vector<BusDevice>& devices, double bit_rate, double data_bit_rate = 0);

/// The motors and sensors on one of a robot's buses, each under its joint's or its own name.
/// @param bus index into the robot's buses. @throws std::invalid_argument for an unknown protocol.
std::vector<BusDevice> BusDevices(const RobotDescription& robot, size_t bus);
BusPlan PlanBus(const RobotDescription& robot, size_t bus);  ///< of these

/// A table for people: messages, loads, response times, errors and warnings.
std::string ToText(const BusPlan& plan);

}  // namespace plumb
