// libFuzzer: a moteus' host and the virtual motor, see MotorGame.

#include <cmath>
#include <numbers>

#include "drivers/protocols/moteus_device.h"
#include "drivers/protocols/moteus_host.h"
#include "tests/fuzz/motor_game.h"

namespace plumb {
namespace {

using namespace moteus;

constexpr double kTurn = 2 * std::numbers::pi;  // [rad]

class Drive : public VirtualDrive {
 public:
  explicit Drive(const MoteusDevice::Settings& settings) : settings_(settings), device_(settings) {
    device_.Reboot(MotorGame::kStart, 0);
  }

  std::vector<uint32_t> ids() const override {
    return {CommandId(settings_.node), AnswerId(settings_.node),
            static_cast<uint32_t>(settings_.node), CommandId(kEverybody)};
  }
  bool fd() const override { return true; }
  void OnFrame(const Frame& frame, int64_t now) override { device_.OnFrame(frame, now); }
  void Tick(int64_t now, FrameBatch& out) override {
    device_.Tick(now, sample_, out);
    if (device_.mode() != kPositionMode && settings_.timeout_mode == kStopped)
      Require(device_.Torque(sample_) == 0);
  }
  int64_t NextDue() const override { return device_.NextDue(); }
  bool armed() const override { return device_.armed(); }
  double Torque() const override { return device_.Torque(sample_); }
  int64_t rejected() const override { return device_.rejected(); }

  void Surprise(Bytes& bytes, bool, int64_t now) override {
    const uint8_t what = bytes.Byte();
    if (what < 64) {
      zero_ = sample_.position;
      device_.Reboot(now, zero_);
    } else {
      device_.set_fault(what % 4 == 0 ? 0 : 32 + what % 19);
    }
  }
  void Heal() override {
    device_.set_fault(0);
    sample_ = {};
    zero_ = 0;
    device_.Reboot(now_, 0);
  }
  void Move(Bytes& bytes, bool sane) override {
    sample_.velocity = sane ? bytes.Modest(30) : bytes.Number();
    if (!sane) sample_.position = bytes.Number();
  }
  void Turn(int64_t microseconds) override {
    now_ += microseconds;
    sample_.position += sample_.velocity * static_cast<double>(microseconds) * 1e-6;
  }

  std::optional<double> TorqueIn(const Frame& frame) const override {
    if (!IsMine(frame)) return {};
    if (IsStop(frame)) return 0;
    if (!HasShape(kCommand, frame)) return {};
    const FieldValues values = *DecodePayload(kCommand.layout, frame);
    const auto& [mode, position, velocity, torque, kp, kd, most, timeout, integral, a, b, c] =
        values;
    Require(mode == int{kPositionMode} && std::isnan(position) && velocity == 0 && kp == 0 &&
            kd == 0 && integral == 0 && timeout == 100 &&
            std::abs(most - settings_.most_torque) < 1e-6);
    return torque;
  }
  double max_torque() const override { return settings_.most_torque; }
  double Rounding(double torque) const override { return 1e-6 + 1e-7 * std::abs(torque); }
  bool MayBeTold(const Frame& frame, DriveState) const override {
    const Frame question = MakeFrame(CommandId(settings_.node), {kQuestion});
    return SameOnWire(frame, question) || SameOnWire(frame, MakeStop(settings_.node));
  }
  bool Agrees(const MotorEstimate& estimate) const override {
    const double position = sample_.position - zero_, velocity = sample_.velocity;
    return std::abs(estimate.position - position) <= 1e-6 + 1e-6 * std::abs(position) &&
           std::abs(estimate.velocity - velocity) <= 1e-6 + 1e-6 * std::abs(velocity);
  }

 private:
  bool IsMine(const Frame& frame) const {
    return frame.fd && frame.bit_rate_switch && frame.extended &&
           frame.id == CommandId(settings_.node);
  }
  static bool IsStop(const Frame& frame) {
    return frame.length > 3 && frame.data[0] == (kWrite | kInt8 | 1) && frame.data[1] == kMode &&
           frame.data[2] == kStopped;
  }

  const MoteusDevice::Settings settings_;
  MoteusDevice device_;
  MoteusDevice::Sample sample_;
  double zero_ = 0;
  int64_t now_ = MotorGame::kStart;
};

}  // namespace
}  // namespace plumb

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  Bytes bytes({data, size});
  const uint8_t kind = bytes.Byte();
  // Answers with ids of 11 bits and of 29.
  MoteusDevice::Settings settings;
  settings.node = (kind & 1) != 0 ? 5 : 0x5A;
  settings.most_torque = (kind & 2) != 0 ? 1 : 150;
  MotorDescription description;
  description.protocol = "moteus";
  description.node = settings.node;
  description.moteus = MoteusDescription{.torque = settings.most_torque, .watchdog = 0.1};
  MotorGame(MakeMoteusMotor(description, {200'000}), std::make_unique<Drive>(settings), bytes)
      .Play();
  return 0;
}
