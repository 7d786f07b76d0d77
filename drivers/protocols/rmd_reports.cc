#include "drivers/protocols/rmd_reports.h"

#include <numbers>
#include <utility>

#include "drivers/protocols/rmd.h"

namespace plumb {
namespace {

using namespace rmd;

constexpr double kDegree = std::numbers::pi / 180;  // [rad]
constexpr int64_t kTogether = 20'000;               // [us] between a speed and its angle, at most

}  // namespace

FrameUse RmdReports::OnAnswer(const Frame& frame, int64_t now) noexcept {
  switch (frame.data[0]) {
    case kTorqueControl:
      OnMotion(*DecodePayload(kTorqueAnswer, frame), now);
      break;
    case kAskMotion:
      OnMotion(*DecodePayload(kMotion, frame), now);
      break;
    case kAskAngle:
      estimate_.position = (*DecodePayload(kAngle, frame))[1] * kDegree;
      if (std::exchange(speed_known_, false) && now - speed_at_ <= kTogether)
        return FrameUse::kEstimate;
      break;
    case kAskStatus:
      OnStatus(*DecodePayload(kStatus, frame), now);
      break;
    case kAskUptime:
      uptime_.OnUptime(static_cast<uint32_t>((*DecodePayload(kUptime, frame))[1]), now);
      break;
    case kAskVersion:
      version_ = static_cast<uint32_t>((*DecodePayload(kVersion, frame))[1]);
      Identify();
      break;
    case kAskModel:
      for (size_t i = 0; i < model_.size(); ++i) {
        const auto letter = static_cast<char>(frame.data[i + 1]);
        model_[i] = letter > ' ' && letter <= '~' ? letter : '?';
      }
      Identify();
      break;
    default:
      break;
  }
  return FrameUse::kConsumed;
}

void RmdReports::Identify() noexcept {
  if (version_ == 0 || model_[0] == 0) return;
  identity_.Set("{}, software of {}", std::string_view(model_.data(), model_.size()), version_);
}

void RmdReports::OnMotion(const FieldValues& values, int64_t now) noexcept {
  readings_.motor_temperature = values[1];
  readings_.temperatures_at = now;
  torque_estimate_ = values[2] * torque_constant_;
  estimate_.velocity = values[3] * kDegree;
  speed_known_ = true;
  speed_at_ = now;
}

void RmdReports::OnStatus(const FieldValues& values, int64_t now) noexcept {
  readings_.motor_temperature = values[1];
  readings_.temperatures_at = now;
  readings_.bus_voltage = values[3];
  errors_ = static_cast<uint32_t>(values[4]);
}

}  // namespace plumb
