// Of cansimple.h: the drive's error codes in words.
#include <array>

#include "drivers/protocols/cansimple.h"
#include "drivers/protocols/error_words.h"

namespace plumb::cansimple {
namespace {

constexpr ErrorWord kErrorWords[] = {
    {1u << 0, "initializing"},
    {1u << 1, "system level error"},
    {1u << 2, "timing error"},
    {1u << 3, "missing estimate"},
    {1u << 4, "bad configuration"},
    {1u << 5, "gate driver fault"},
    {1u << 6, "missing input"},
    {1u << 8, "DC bus over-voltage"},
    {1u << 9, "DC bus under-voltage"},
    {1u << 10, "DC bus over-current"},
    {1u << 11, "DC bus over-regeneration current"},
    {1u << 12, "current limit violation"},
    {1u << 13, "motor over-temperature"},
    {1u << 14, "inverter over-temperature"},
    {1u << 15, "velocity limit violation"},
    {1u << 16, "position limit violation"},
    {1u << 24, "watchdog timer expired"},
    {1u << 25, "estop requested"},
    {1u << 26, "spinout detected"},
    {1u << 27, "brake resistor disarmed"},
    {1u << 28, "thermistor disconnected"},
    {1u << 30, "calibration error"},
};

constexpr std::array<std::string_view, 17> kStates = {"UNDEFINED",
                                                      "IDLE",
                                                      "STARTUP_SEQUENCE",
                                                      "FULL_CALIBRATION_SEQUENCE",
                                                      "MOTOR_CALIBRATION",
                                                      "state 5",
                                                      "ENCODER_INDEX_SEARCH",
                                                      "ENCODER_OFFSET_CALIBRATION",
                                                      "CLOSED_LOOP_CONTROL",
                                                      "LOCKIN_SPIN",
                                                      "ENCODER_DIR_FIND",
                                                      "HOMING",
                                                      "HALL_POLARITY_CALIBRATION",
                                                      "HALL_PHASE_CALIBRATION",
                                                      "ANTICOGGING_CALIBRATION",
                                                      "HARMONIC_CALIBRATION",
                                                      "HARMONIC_CALIBRATION_COMMUTATION"};

constexpr std::array<std::string_view, 16> kResults = {"success",
                                                       "busy",
                                                       "cancelled",
                                                       "disarmed",
                                                       "no response",
                                                       "pole pair or CPR mismatch",
                                                       "phase resistance out of range",
                                                       "phase inductance out of range",
                                                       "unbalanced phases",
                                                       "invalid motor type",
                                                       "illegal hall state",
                                                       "timeout",
                                                       "homing without endstop",
                                                       "invalid state",
                                                       "not calibrated",
                                                       "not converging"};

}  // namespace

std::string_view DescribeErrors(uint32_t errors, std::span<char> buffer) noexcept {
  return DescribeBits(errors, kErrorWords, buffer);
}

std::string_view DescribeAxisState(int state) noexcept {
  return state >= 0 && static_cast<size_t>(state) < kStates.size()
             ? kStates[static_cast<size_t>(state)]
             : "unknown state";
}

std::string_view DescribeProcedureResult(int result) noexcept {
  return result >= 0 && static_cast<size_t>(result) < kResults.size()
             ? kResults[static_cast<size_t>(result)]
             : "unknown result";
}

}  // namespace plumb::cansimple
