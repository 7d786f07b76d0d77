// Of moteus.h: the motor's faults and modes in words.

#include <algorithm>
#include <iterator>

#include "drivers/protocols/moteus.h"

namespace plumb::moteus {
namespace {

struct Word {
  int code;
  std::string_view words;
};
// Register 0x00f in docs/protocol/registers.md; 104 and 105 from fw/error.h.
constexpr Word kFaults[] = {
    {0, "no fault"},
    {32, "calibration fault"},
    {33, "motor driver fault, maybe too weak a supply"},
    {34, "over voltage"},
    {35, "encoder fault"},
    {36, "motor not configured"},
    {37, "pwm cycle overrun"},
    {38, "over temperature"},
    {39, "outside the position limits stored in it"},
    {40, "under voltage"},
    {41, "configuration changed"},
    {42, "no valid commutation encoder"},
    {43, "no valid output encoder"},
    {44, "gate driver not enabled"},
    {45, "stop position is deprecated"},
    {46, "timing violation"},
    {47, "bemf_feedforward without an acceleration limit"},
    {48, "invalid position limits stored in it"},
    {49, "position error beyond its threshold"},
    {50, "velocity error beyond its threshold"},
    {96, "limited by its velocity"},
    {97, "limited by its power"},
    {98, "limited by its voltage"},
    {99, "limited by its current"},
    {100, "limited by its temperature"},
    {101, "limited by the motor's temperature"},
    {102, "limited by the commanded torque"},
    {103, "limited by its position"},
    {104, "flux braking"},
    {105, "field weakening"},
};
// Register 0x000.
constexpr Word kModes[] = {
    {0, "stopped"},        {1, "fault"},        {2, "enabling"},
    {3, "calibrating"},    {4, "calibrated"},   {5, "PWM"},
    {6, "voltage"},        {7, "voltage FOC"},  {8, "voltage DQ"},
    {9, "current"},        {10, "position"},    {11, "timeout"},
    {12, "zero velocity"}, {13, "stay within"}, {14, "measure inductance"},
    {15, "brake"},
};

template <size_t count>
std::string_view Find(const Word (&words)[count], int code, std::string_view otherwise) noexcept {
  const auto found = std::ranges::find(words, code, &Word::code);
  return found == std::end(words) ? otherwise : found->words;
}

}  // namespace

std::string_view DescribeFault(int fault) noexcept {
  return Find(kFaults, fault, "an unknown fault");
}

std::string_view DescribeMode(int mode) noexcept { return Find(kModes, mode, "an unknown mode"); }

}  // namespace plumb::moteus
