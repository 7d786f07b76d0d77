// Of cansimple.h: the drive's error codes in words.
#include <array>

#include "drivers/protocols/cansimple.h"

namespace plumb::cansimple {
namespace {

struct ErrorWord {
  int bit;
  std::string_view words;
};
constexpr ErrorWord kErrorWords[] = {
    {0, "initializing"},
    {1, "system level error"},
    {2, "timing error"},
    {3, "missing estimate"},
    {4, "bad configuration"},
    {5, "gate driver fault"},
    {6, "missing input"},
    {8, "DC bus over-voltage"},
    {9, "DC bus under-voltage"},
    {10, "DC bus over-current"},
    {11, "DC bus over-regeneration current"},
    {12, "current limit violation"},
    {13, "motor over-temperature"},
    {14, "inverter over-temperature"},
    {15, "velocity limit violation"},
    {16, "position limit violation"},
    {24, "watchdog timer expired"},
    {25, "estop requested"},
    {26, "spinout detected"},
    {27, "brake resistor disarmed"},
    {28, "thermistor disconnected"},
    {30, "calibration error"},
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
  if (errors == 0) return "no error";
  size_t size = 0;
  const auto append = [&](std::string_view words) {
    for (const char c : words) {
      if (size < buffer.size()) buffer[size++] = c;
    }
  };
  for (const ErrorWord& error : kErrorWords) {
    if ((errors >> error.bit & 1) == 0) continue;
    if (size > 0) append(", ");
    append(error.words);
    errors &= ~(1u << error.bit);
  }
  if (errors != 0) append(size > 0 ? ", unknown error" : "unknown error");
  return {buffer.data(), size};
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
