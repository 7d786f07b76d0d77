#include "drivers/protocols/moteus_subframes.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "common/special_numbers.h"

namespace plumb::moteus {
namespace {

/// [unit of a register] of one step of an integer; 1 of what is counted. docs/protocol/registers.md
struct Scale {
  double of_int8, of_int16, of_int32;
};
Scale ScaleOf(uint32_t number) {
  switch (number) {
    case kPosition:
    case kCommandPosition:
      return {0.01, 0.0001, 0.00001};
    case kVelocity:
    case kCommandVelocity:
      return {0.1, 0.00025, 0.00001};
    case kTorque:
    case kCommandTorque:
    case kMaxTorque:
      return {0.5, 0.01, 0.001};
    case kKpScale:
    case kKdScale:
    case kIntegralScale:
      return {1. / 127, 1. / 32767, 1. / 2147483647};
    case kTimeout:
      return {0.01, 0.001, 0.000001};
    case kVoltage:
      return {0.5, 0.1, 0.001};
    case kTemperature:
    case kMotorTemperature:
      return {1, 0.1, 0.001};
    default:
      return {1, 1, 1};
  }
}
double StepOf(uint32_t number, int format) {
  const Scale scale = ScaleOf(number);
  return format == kInt8 ? scale.of_int8 : format == kInt16 ? scale.of_int16 : scale.of_int32;
}
int BytesOf(int format) { return format == kInt8 ? 1 : format == kInt16 ? 2 : 4; }

bool IsCounted(uint32_t number) {
  const Scale scale = ScaleOf(number);
  return scale.of_int8 == 1 && scale.of_int16 == 1 && scale.of_int32 == 1;
}

}  // namespace

std::optional<uint32_t> SubframeReader::Byte() {
  if (empty()) return {};
  return bytes_[at_++];
}

std::optional<uint32_t> SubframeReader::Number() {
  uint32_t number = 0;
  for (int shift = 0; shift < 35; shift += 7) {
    const auto byte = Byte();
    if (!byte) return {};
    number |= (*byte & 0x7F) << std::min(shift, 31);
    if ((*byte & 0x80) == 0) return number;
  }
  return {};
}

std::optional<SubframeReader::Registers> SubframeReader::RegistersOf(uint32_t subframe) {
  const auto count = (subframe & 3) != 0 ? std::optional<uint32_t>(subframe & 3) : Number(),
             first = count ? Number() : count;
  if (!first) return {};
  return Registers{*count, *first, static_cast<int>(subframe & 0x0C)};
}

std::optional<double> SubframeReader::Value(uint32_t number, int format) {
  uint32_t raw = 0;
  const int count = BytesOf(format);
  for (int byte = 0; byte < count; ++byte) {
    const auto next = Byte();
    if (!next) return {};
    raw |= *next << 8 * byte;
  }
  if (format == kFloat) return std::bit_cast<float>(raw);
  const int unused = 32 - 8 * count;
  const int32_t value = static_cast<int32_t>(raw << unused) >> unused;
  if (value == std::numeric_limits<int32_t>::min() >> unused && number != kMode) return kNaN;
  return value * StepOf(number, format);
}

std::optional<uint32_t> SubframeReader::TextSize() {
  const auto channel = Number(), size = Number();
  return channel == 1u ? size : std::nullopt;
}

std::optional<std::string_view> SubframeReader::Text(size_t size) {
  if (bytes_.size() - at_ < size) return {};
  const std::string_view text(reinterpret_cast<const char*>(bytes_.data() + at_), size);
  at_ += size;
  return text;
}

void SubframeWriter::Byte(uint32_t byte) {
  if (size_ < bytes_.size()) bytes_[size_++] = static_cast<uint8_t>(byte);
}

void SubframeWriter::Number(uint32_t number) {
  for (; number > 0x7F; number >>= 7) Byte((number & 0x7F) | 0x80);
  Byte(number);
}

void SubframeWriter::Refuse(Subframe error, uint32_t number) {
  Byte(error);
  Number(number);
  Number(1);
}

void SubframeWriter::Value(uint32_t number, int format, double value) {
  uint32_t raw = 0;
  const int count = BytesOf(format);
  const double most = std::ldexp(1, 8 * count - 1) - 1;
  if (format == kFloat) {
    raw = std::bit_cast<uint32_t>(static_cast<float>(value));
  } else if (IsCounted(number)) {
    raw = static_cast<uint32_t>(static_cast<int64_t>(value));
  } else if (!std::isfinite(value)) {
    raw = static_cast<uint32_t>(static_cast<int64_t>(-most - 1));
  } else {
    raw = static_cast<uint32_t>(
        static_cast<int64_t>(std::clamp(value / StepOf(number, format), -most, most)));
  }
  for (int byte = 0; byte < count; ++byte) Byte(raw >> 8 * byte & 0xFF);
}

}  // namespace plumb::moteus
