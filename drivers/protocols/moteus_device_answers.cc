// Of moteus_device.h: what a virtual moteus answers.

#include <algorithm>
#include <array>
#include <optional>
#include <string>

#include "drivers/protocols/moteus_device.h"

namespace plumb {
namespace {

using namespace moteus;

constexpr uint32_t kFirmware = 0x000107;  // made up

// Of position mode, those that are of no use here included.
bool IsWritable(uint32_t number) {
  return number == kMode || (number >= kCommandPosition && number <= 0x02D);
}

}  // namespace

std::optional<double> MoteusDevice::Read(uint32_t source, const Sample& sample,
                                         int64_t now) const noexcept {
  switch (source) {
    case kMode:
      return mode_;
    case kPosition:
      return (sample.position - zero_) / kTurn;
    case kVelocity:
      return sample.velocity / kTurn;
    case kTorque:
      return Torque(sample);
    case kMotorTemperature:
      return motor_temperature_;
    case kTrajectoryComplete:
      return 0;
    case kHomeState:
      return 1;  // a place within a turn of the rotor
    case kVoltage:
      return settings_.bus_voltage;
    case kTemperature:
      return settings_.temperature;
    case kFault:
      return fault_;
    case kMilliseconds:
      return static_cast<double>(static_cast<uint32_t>((now - booted_) / 1000));
    case kFirmwareVersion:
      return kFirmware;
    case kRegisterMap:
      return settings_.register_map;
    default:
      return {};
  }
}

// As much of its console's text as there is and may come.
void MoteusDevice::Say(size_t most, SubframeWriter& writer) noexcept {
  const size_t size = std::min(text_.size(), most);
  writer.Byte(kFromMotor);
  writer.Number(1);
  writer.Number(static_cast<uint32_t>(size));
  for (size_t i = 0; i < size; ++i) writer.Byte(static_cast<uint8_t>(text_[i]));
  text_.erase(0, size);
}

// The registers, or which is the first of them that it does not know, and then nothing more.
bool MoteusDevice::Reply(uint32_t subframe, const SubframeReader::Registers& registers,
                         const Sample& sample, int64_t now, SubframeWriter& writer) const noexcept {
  const auto [count, first, format] = registers;
  std::array<double, 64> values{};
  uint32_t known = 0;
  for (; known < std::min<uint32_t>(count, 64); ++known) {
    const auto value = Read(first + known, sample, now);
    if (!value) break;
    values[known] = *value;
  }
  if (known < count) {
    writer.Refuse(kReadError, first + known);
    return false;
  }
  writer.Byte((subframe & 0x0F) | kReply);
  if ((subframe & 3) == 0) writer.Number(count);
  writer.Number(first);
  for (uint32_t i = 0; i < known; ++i) writer.Value(first + i, format, values[i]);
  return true;
}

// What was asked for, in the order in which it was.
void MoteusDevice::ReplyToAll(const Sample& sample, int64_t now, SubframeWriter& writer) noexcept {
  constexpr size_t kText = 32;
  SubframeReader reader(question_);
  while (!reader.empty()) {
    const uint32_t subframe = *reader.Byte();
    if (subframe == kNothing) continue;
    if (subframe == kToMotor || subframe == kAskText) {
      const auto size = reader.TextSize();
      if (!size) return;
      Say(subframe == kAskText ? std::min<size_t>(*size, kText) : kText, writer);
      if (subframe == kToMotor && !reader.Text(*size)) return;
      continue;
    }
    if ((subframe & 0xF0) > kRead) return;
    const auto registers = reader.RegistersOf(subframe);
    if (!registers) return;
    if ((subframe & 0xF0) == kRead) {
      if (!Reply(subframe, *registers, sample, now, writer)) return;
      continue;
    }
    for (uint32_t i = 0; i < registers->count; ++i) {
      if (!reader.Value(registers->first + i, registers->format)) return;
      if (!IsWritable(registers->first + i)) writer.Refuse(kWriteError, registers->first + i);
    }
  }
}

Frame MoteusDevice::Answer(const Sample& sample, int64_t now) noexcept {
  SubframeWriter writer;
  ReplyToAll(sample, now, writer);
  // Commands of the console end with a line.
  for (size_t end = 0; (end = heard_.find('\n')) != std::string::npos; heard_.erase(0, end + 1)) {
    text_ = heard_.substr(0, end + 1) == kAskTimeoutMode
                ? std::to_string(settings_.timeout_mode) + "\r\n"
                : "ERR unknown command\r\n";
  }
  Frame frame = MakeFrame(AnswerId(settings_.node) | (question_.id >> 8 & 0x7F), {writer.bytes()});
  frame.fd = question_.fd || frame.length > 8;
  frame.bit_rate_switch = frame.fd && question_.bit_rate_switch;
  return frame;
}

}  // namespace plumb
