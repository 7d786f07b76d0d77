#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "drivers/protocols/fields.h"

/// ODrive's CANSimple, firmware 0.6: 11-bit ids `node << 5 | command`, little-endian payloads,
/// positions in revolutions and torques in Nm at the motor's shaft. Layouts from ODrive Robotics'
/// "CAN Protocol" manual (docs.odriverobotics.com/v/latest/manual/can-protocol.html). Host and
/// virtual drive share these tables; tests/drivers/protocols/cansimple_test.cc checks them
/// against frames written by hand. Constants and pure functions: thread-safe.
namespace plumb::cansimple {

inline constexpr int kMaxNode = 0x3E;
inline constexpr int kBroadcastNode = 0x3F;

namespace detail {
constexpr Field U(std::string_view name, int bit, int bits, std::string_view unit = "") {
  return {name, static_cast<uint8_t>(bit), static_cast<uint8_t>(bits), Field::Kind::kUnsigned, 1,
          unit};
}
constexpr Field I16(std::string_view name, int bit, double scale, std::string_view unit) {
  return {name, static_cast<uint8_t>(bit), 16, Field::Kind::kSigned, scale, unit};
}
constexpr Field F(std::string_view name, int bit, std::string_view unit) {
  return {name, static_cast<uint8_t>(bit), 32, Field::Kind::kFloat, 1, unit};
}
}  // namespace detail

using detail::F;
using detail::I16;
using detail::U;

// clang-format off
// From the drive: cyclic, or in answer to a remote frame of the same id.
inline constexpr Layout kGetVersion{0x00, "Get_Version", 8,
    {{U("Protocol_Version", 0, 8), U("Hw_Version_Major", 8, 8), U("Hw_Version_Minor", 16, 8),
      U("Hw_Version_Variant", 24, 8), U("Fw_Version_Major", 32, 8), U("Fw_Version_Minor", 40, 8),
      U("Fw_Version_Revision", 48, 8), U("Fw_Version_Unreleased", 56, 8)}}};
inline constexpr Layout kHeartbeat{0x01, "Heartbeat", 8,
    {{U("Axis_Error", 0, 32), U("Axis_State", 32, 8), U("Procedure_Result", 40, 8),
      U("Trajectory_Done_Flag", 48, 1)}}};
inline constexpr Layout kGetError{0x03, "Get_Error", 8,
    {{U("Active_Errors", 0, 32), U("Disarm_Reason", 32, 32)}}};
inline constexpr Layout kTxSdo{0x05, "TxSdo", 8,
    {{U("Reserved0", 0, 8), U("Endpoint_ID", 8, 16), U("Reserved1", 24, 8), F("Value", 32, "")}}};
inline constexpr Layout kAddress{
    0x06, "Address", 7, {{U("Node_ID", 0, 8), U("Serial_Number", 8, 48)}}};
inline constexpr Layout kGetEncoderEstimates{0x09, "Get_Encoder_Estimates", 8,
    {{F("Pos_Estimate", 0, "rev"), F("Vel_Estimate", 32, "rev/s")}}};
inline constexpr Layout kGetIq{
    0x14, "Get_Iq", 8, {{F("Iq_Setpoint", 0, "A"), F("Iq_Measured", 32, "A")}}};
inline constexpr Layout kGetTemperature{0x15, "Get_Temperature", 8,
    {{F("FET_Temperature", 0, "degC"), F("Motor_Temperature", 32, "degC")}}};
inline constexpr Layout kGetBusVoltageCurrent{0x17, "Get_Bus_Voltage_Current", 8,
    {{F("Bus_Voltage", 0, "V"), F("Bus_Current", 32, "A")}}};
inline constexpr Layout kGetTorques{0x1C, "Get_Torques", 8,
    {{F("Torque_Target", 0, "Nm"), F("Torque_Estimate", 32, "Nm")}}};
inline constexpr Layout kGetPowers{0x1D, "Get_Powers", 8,
    {{F("Electrical_Power", 0, "W"), F("Mechanical_Power", 32, "W")}}};

// To the drive: not acknowledged.
inline constexpr Layout kEstop{0x02, "Estop", 0, {}};
inline constexpr Layout kRxSdo{0x04, "RxSdo", 8,
    {{U("Opcode", 0, 8), U("Endpoint_ID", 8, 16), U("Reserved", 24, 8), F("Value", 32, "")}}};
inline constexpr Layout kRxSdoRead{0x04, "RxSdo", 4,
    {{U("Opcode", 0, 8), U("Endpoint_ID", 8, 16), U("Reserved", 24, 8)}}};
inline constexpr Layout kSetAxisState{
    0x07, "Set_Axis_State", 8, {{U("Axis_Requested_State", 0, 32)}}};
inline constexpr Layout kSetControllerMode{0x0B, "Set_Controller_Mode", 8,
    {{U("Control_Mode", 0, 32), U("Input_Mode", 32, 32)}}};
inline constexpr Layout kSetInputPos{0x0C, "Set_Input_Pos", 8,
    {{F("Input_Pos", 0, "rev"), I16("Vel_FF", 32, 0.001, "rev/s"),
      I16("Torque_FF", 48, 0.001, "Nm")}}};
inline constexpr Layout kSetInputVel{0x0D, "Set_Input_Vel", 8,
    {{F("Input_Vel", 0, "rev/s"), F("Input_Torque_FF", 32, "Nm")}}};
inline constexpr Layout kSetInputTorque{
    0x0E, "Set_Input_Torque", 8, {{F("Input_Torque", 0, "Nm")}}};
/// The same in 95 bits at worst instead of 135: what comes after the torque may be left out.
inline constexpr Layout kSetInputTorqueShort{
    0x0E, "Set_Input_Torque", 4, {{F("Input_Torque", 0, "Nm")}}};
inline constexpr Layout kClearErrors{0x18, "Clear_Errors", 1, {{U("Identify", 0, 8)}}};

/// What else a drive obeys, in whatever mode it is: setpoints of position and velocity, both of
/// which set the torque, too, parameters, limits and trajectories, a restart, another zero, gains,
/// a new firmware.
inline constexpr std::array<uint8_t, 13> kOtherCommands = {
    kRxSdo.command, kSetInputPos.command, kSetInputVel.command,
    0x0F, 0x10, 0x11, 0x12, 0x13,  // Set_Limits, anticogging, Set_Traj_...
    0x16, 0x19, 0x1A, 0x1B, 0x1F}; // Reboot, Set_Absolute_Position, gains, Enter_DFU_Mode
// clang-format on

/// Reports that the driver asks for in turn while the robot moves.
inline constexpr std::array kPolledReports = {kGetTemperature, kGetBusVoltageCurrent};

enum AxisState : uint8_t { kUndefined = 0, kIdle = 1, kClosedLoopControl = 8 };
enum ControlMode : uint8_t {
  kVoltageControl = 0,
  kTorqueControl = 1,
  kVelocityControl = 2,
  kPositionControl = 3
};
enum InputMode : uint8_t { kInactive = 0, kPassthrough = 1 };
enum ProcedureResult : uint8_t {
  kSuccess = 0,
  kBusy = 1,
  kCancelled = 2,
  kDisarmed = 3,
  kInvalidState = 13
};
inline constexpr uint32_t kWatchdogTimerExpired = 1u << 24;
inline constexpr uint32_t kEstopRequested = 1u << 25;

/// A data frame of the layout's full length, values in the order of its fields.
constexpr Frame Make(const Layout& layout, int node, std::initializer_list<double> values = {}) {
  Frame frame;
  frame.id = static_cast<uint32_t>(node) << 5 | layout.command;
  EncodePayload(layout, values, frame);
  return frame;
}

/// The remote frame that asks a drive to send a message.
constexpr Frame MakeRequest(const Layout& layout, int node) {
  Frame frame;
  frame.id = static_cast<uint32_t>(node) << 5 | layout.command;
  frame.remote = true;
  return frame;
}

/// Words for the error bits, such as "watchdog timer expired, estop requested", into a buffer.
/// @return the part of the buffer that was written; "no error" for 0.
std::string_view DescribeErrors(uint32_t errors, std::span<char> buffer) noexcept;
std::string_view DescribeAxisState(int state) noexcept;
std::string_view DescribeProcedureResult(int result) noexcept;

}  // namespace plumb::cansimple
