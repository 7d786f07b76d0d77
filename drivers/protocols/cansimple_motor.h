#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <utility>

#include "drivers/protocols/cansimple.h"
#include "drivers/protocols/cansimple_reports.h"
#include "drivers/protocols/stepped_motor.h"

namespace plumb {

enum class CanSimpleStep { kRest, kVersion, kClear, kMode, kState, kAwait, kArmed, kDisarming };

/// The host's side of an ODrive, see MakeCanSimpleMotor: its steps are told from its heartbeats.
/// Not thread-safe.
class CanSimpleMotor : public SteppedMotor<CanSimpleStep> {
 public:
  /// @param node in [0, kMaxNode].
  CanSimpleMotor(int node, const MotorTiming& timing)
      : SteppedMotor(Step::kRest, timing, {"no heartbeat yet", "no heartbeat any more"}),
        node_(node) {}

  Filter filter() const override {
    return {.id = static_cast<uint32_t>(node_) << 5, .mask = 0x7E0};
  }

  FrameUse OnFrame(const Frame& frame, int64_t now) noexcept override;
  const MotorEstimate& estimate() const noexcept override { return reports_.estimate(); }
  double torque_estimate() const noexcept override { return reports_.torque_estimate(); }
  MotorReadings readings() const noexcept override { return reports_.readings(); }
  std::string_view identity() const noexcept override { return reports_.identity(); }

  void Disarm(int64_t now) noexcept override;
  void Estop(int64_t now) noexcept override;
  bool IsEstop(const Frame& frame) const noexcept override;
  void Tick(int64_t now, bool may_arm, FrameBatch& out) noexcept override;
  int num_polled() const noexcept override {
    return static_cast<int>(cansimple::kPolledReports.size());
  }
  void Poll(FrameBatch& out) noexcept override;
  Frame Torque(double torque) noexcept override;
  void Displaced() noexcept override {
    reports_.Displaced();
    SteppedMotor::Displaced();
  }
  bool confirmed_idle() const noexcept override {
    return SteppedMotor::confirmed_idle() && !estop_due_;
  }

 private:
  using Step = CanSimpleStep;
  static bool Spoken(const CanSimpleReports::Firmware& firmware) noexcept {
    return firmware.major == 0 && firmware.minor == 6;
  }

  void BeginArming(int64_t now) noexcept override;
  void ForgetAnswers() noexcept override { beats_ = 0; }
  void OnSent(int64_t now) noexcept override;
  void PushArmingFrames(FrameBatch& out) noexcept;
  void TickDisarming(int64_t now, FrameBatch& out) noexcept;

  FrameUse OnHeartbeat(const Frame& frame, int64_t now) noexcept;
  FrameUse OnError(const Frame& frame) noexcept;

  std::string_view Words(uint32_t errors) noexcept {
    return cansimple::DescribeErrors(errors, words_);
  }

  template <class... Args>
  void Fail(int64_t now, fmt::format_string<Args...> format, Args&&... args) noexcept {
    Explain(format, std::forward<Args>(args)...);
    SetFault();
    // Even one that says it has stopped: it may be another with its node id that has spoken.
    Disarm(now);
  }

  const int node_;
  CanSimpleReports reports_;
  uint32_t axis_error_ = 0;
  int axis_state_ = cansimple::kUndefined, procedure_result_ = 0;
  bool axis_state_known_ = false;  // since the last disarm
  std::array<char, 100> words_;

  int beats_ = 0, disarms_ = 0;  // heard in this step; accepted
  bool order_due_ = false;       // no order to stop was accepted since the last order to run
  bool estop_due_ = false;       // no Estop was accepted since it was asked for
  bool ask_error_ = false;
  size_t poll_turn_ = 0;
};

}  // namespace plumb
