#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <utility>

#include "drivers/protocols/cansimple.h"
#include "drivers/protocols/cansimple_reports.h"
#include "drivers/protocols/motor.h"
#include "drivers/protocols/reason.h"

namespace plumb {

/// The host's side of an ODrive, see MakeCanSimpleMotor: steps from rest through arming to armed
/// and through disarming back to rest, told from its heartbeats. Not thread-safe.
class CanSimpleMotor : public Motor {
 public:
  /// @param node in [0, kMaxNode].
  CanSimpleMotor(int node, const MotorTiming& timing) : node_(node), timing_(timing) {}

  Filter filter() const override {
    return {.id = static_cast<uint32_t>(node_) << 5, .mask = 0x7E0};
  }

  FrameUse OnFrame(const Frame& frame, int64_t now) noexcept override;
  const MotorEstimate& estimate() const noexcept override { return reports_.estimate(); }
  double torque_estimate() const noexcept override { return reports_.torque_estimate(); }
  MotorReadings readings() const noexcept override { return reports_.readings(); }
  std::string_view identity() const noexcept override { return reports_.identity(); }

  void Arm(int64_t now) noexcept override;
  void Disarm(int64_t now) noexcept override;
  void Estop(int64_t now) noexcept override;
  bool lost_place() const noexcept override { return lost_place_; }
  void Homed() noexcept override { lost_place_ = false; }
  bool IsEstop(const Frame& frame) const noexcept override;
  void Tick(int64_t now, bool may_arm, FrameBatch& out) noexcept override;
  int num_polled() const noexcept override {
    return static_cast<int>(cansimple::kPolledReports.size());
  }
  void Poll(FrameBatch& out) noexcept override;
  void Transmitted(bool all, int64_t now) noexcept override;
  Frame Torque(double torque) noexcept override;
  void Displaced() noexcept override {
    reports_.Displaced();
    lost_place_ = false;
  }
  int64_t saturations() const noexcept override { return saturations_; }

  DriveState state() const noexcept override;
  std::string_view reason() const noexcept override;
  bool confirmed_idle() const noexcept override;

 private:
  enum class Step { kRest, kVersion, kClear, kMode, kState, kAwait, kArmed, kDisarming };
  static bool Spoken(const CanSimpleReports::Firmware& firmware) noexcept {
    return firmware.major == 0 && firmware.minor == 6;
  }

  bool Arming() const noexcept { return step_ >= Step::kVersion && step_ <= Step::kAwait; }
  void Enter(Step step, int64_t now) noexcept;
  bool Retry(int64_t now) noexcept;
  void PushArmingFrames(FrameBatch& out) noexcept;
  void TickDisarming(int64_t now, FrameBatch& out) noexcept;

  FrameUse OnHeartbeat(const Frame& frame, int64_t now) noexcept;
  FrameUse OnError(const Frame& frame) noexcept;

  std::string_view Words(uint32_t errors) noexcept {
    return cansimple::DescribeErrors(errors, words_);
  }

  template <class... Args>
  void Fail(int64_t now, fmt::format_string<Args...> format, Args&&... args) noexcept {
    reason_.Set(format, std::forward<Args>(args)...);
    fault_ = true;
    // Even one that says it has stopped: it may be another with its node id that has spoken.
    Disarm(now);
  }

  const int node_;
  const MotorTiming timing_;
  CanSimpleReports reports_;
  bool heard_ = false, present_ = false;  // ever, lately
  int64_t heartbeat_ = 0;
  uint32_t axis_error_ = 0;
  int axis_state_ = cansimple::kUndefined, procedure_result_ = 0;
  bool axis_state_known_ = false;  // since the last disarm
  std::array<char, 100> words_;

  Step step_ = Step::kRest;
  int64_t entered_ = 0, retry_ = 0;
  int beats_ = 0, disarms_ = 0;  // heard in this step; accepted
  bool given_ = false;           // the last Tick gave frames
  bool may_run_ = false;         // told to run, or heard running, and not heard idle since
  bool order_due_ = false;       // no order to stop was accepted since the last order to run
  bool estop_due_ = false;       // no Estop was accepted since it was asked for
  bool ask_error_ = false, fault_ = false;
  bool lost_place_ = false;
  size_t poll_turn_ = 0;
  int64_t saturations_ = 0;
  Reason reason_;
};

}  // namespace plumb
