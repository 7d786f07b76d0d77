#include "drivers/protocols/moteus_reports.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "common/special_numbers.h"

namespace plumb {
namespace {

using namespace moteus;

constexpr double kNotANumber = -128;  // of an int8 register

double Reading(double value, double scale = 1) {
  return value == kNotANumber * scale ? kNaN : value;
}

}  // namespace

FrameUse MoteusReports::OnFrame(const Frame& frame, int64_t now) noexcept {
  if (HasShape(kAnswer, frame)) return OnAnswer(*DecodePayload(kAnswer.layout, frame), now);
  if (HasShape(kVersion, frame)) {
    const FieldValues values = *DecodePayload(kVersion.layout, frame);
    const auto firmware = static_cast<uint32_t>(static_cast<int64_t>(values[0]));
    register_map_ = static_cast<int>(values[1]);
    identity_.Set("moteus, firmware {}.{}.{}, register map {}", firmware >> 16 & 0xFFFF,
                  firmware >> 8 & 0xFF, firmware & 0xFF, *register_map_);
    return FrameUse::kConsumed;
  }
  return OnText(frame);
}

FrameUse MoteusReports::OnAnswer(const FieldValues& values, int64_t now) noexcept {
  const auto& [mode, position, velocity, torque, motor_temperature, complete, home, voltage,
               temperature, fault, uptime, none] = values;
  if (!(mode >= 0 && mode <= kLastMode)) return FrameUse::kRejected;  // it is no moteus
  ++answers_;
  mode_ = static_cast<int>(mode);
  fault_ = static_cast<int>(fault);
  torque_estimate_ = std::isfinite(torque) ? torque : kNaN;
  // One without a thermistor says 0.
  readings_.motor_temperature = motor_temperature == 0 ? kNaN : Reading(motor_temperature);
  readings_.drive_temperature = Reading(temperature);
  readings_.bus_voltage = Reading(voltage, kAnswer.layout.fields[7].scale);
  if (!std::isnan(readings_.drive_temperature)) readings_.temperatures_at = now;
  uptime_.OnUptime(static_cast<uint32_t>(static_cast<int64_t>(uptime)), now);
  // Whether it runs one must know of a motor without an encoder, too.
  if (!std::isfinite(position) || !std::isfinite(velocity)) return FrameUse::kNotFinite;
  estimate_ = {position * kTurn, velocity * kTurn};
  return FrameUse::kEstimate;
}

// Of the console: a number and an end of line is what is asked for.
FrameUse MoteusReports::OnText(const Frame& frame) noexcept {
  if (frame.length < 3 || frame.data[0] != kFromMotor || frame.data[1] != 1 ||
      frame.data[2] > frame.length - 3) {
    return FrameUse::kRejected;
  }
  std::array<char, 64> text;
  const size_t size = frame.data[2];
  std::copy_n(frame.data.begin() + 3, size, text.begin());
  if (size == 0) return FrameUse::kConsumed;
  int mode = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + size, mode);
  const std::string_view rest(end, static_cast<size_t>(text.data() + size - end));
  timeout_mode_ = error == std::errc{} && rest == "\r\n" ? mode : -1;
  return FrameUse::kConsumed;
}

void MoteusReports::ForgetSettings() noexcept {
  register_map_.reset();
  timeout_mode_.reset();
}

}  // namespace plumb
