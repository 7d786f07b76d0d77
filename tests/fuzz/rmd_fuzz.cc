// libFuzzer: an RMD motor's host and the virtual motor, see MotorGame.

#include <cmath>
#include <numbers>

#include "drivers/protocols/rmd_device.h"
#include "drivers/protocols/rmd_host.h"
#include "tests/fuzz/motor_game.h"

namespace plumb {
namespace {

using namespace rmd;

constexpr int kNode = 0x11;
constexpr double kDegree = std::numbers::pi / 180;  // [rad]

class Drive : public VirtualDrive {
 public:
  explicit Drive(const RmdDevice::Settings& settings) : settings_(settings), device_(settings) {
    device_.Reboot(MotorGame::kStart, 0);
  }

  std::vector<uint32_t> ids() const override {
    return {kCommands + kNode, kAnswers + kNode, kAllMotors};
  }
  void OnFrame(const Frame& frame, int64_t now) override {
    device_.OnFrame(frame, now);
    if (Feeds(frame)) fed_ = now;
  }
  void Tick(int64_t now, FrameBatch& out) override {
    const bool slept = device_.watchdog() > 0 && now - fed_ >= device_.watchdog();
    device_.Tick(now, sample_, out);
    if (slept && fed_ != now) Require(device_.Torque() == 0);
  }
  int64_t NextDue() const override { return device_.NextDue(); }
  bool armed() const override { return device_.armed(); }
  double Torque() const override { return device_.Torque(); }
  int64_t rejected() const override { return device_.rejected(); }

  void Surprise(Bytes& bytes, bool, int64_t now) override {
    const uint8_t what = bytes.Byte();
    if (what < 64) {
      zero_ = sample_.position;
      device_.Reboot(now, zero_);
      fed_ = now;
    } else {
      device_.set_errors(static_cast<uint16_t>(what % 4 * 0x1002));
    }
  }
  void Heal() override {
    device_.set_errors(0);
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
    if (frame.id != kCommands + kNode || frame.length != 8 || frame.data[0] != kTorqueControl)
      return {};
    return (*DecodePayload(kTorque, frame))[1] * settings_.torque_constant;
  }
  double max_torque() const override { return settings_.current * settings_.torque_constant; }
  double Rounding(double) const override { return 0.00501 * settings_.torque_constant; }
  bool MayBeTold(const Frame& frame, DriveState state) const override {
    if (frame.id != kCommands + kNode || frame.length != 8) return false;
    switch (frame.data[0]) {
      case kShutdown:
      case kLockBrake:
      case kAskAngle:
      case kAskMotion:
        return true;
      case kAskStatus:
      case kReleaseBrake:
      case kSetWatchdog:
        return state == DriveState::kArming || state == DriveState::kAbsent;
      default:
        return false;
    }
  }
  bool Agrees(const MotorEstimate& estimate) const override {
    const double position = sample_.position - zero_, velocity = sample_.velocity;
    if (std::abs(position) > 3e5) return true;  // where codes end
    return std::abs(estimate.position - position) <= 0.0101 * kDegree &&
           std::abs(estimate.velocity - velocity) <= 1.01 * kDegree;
  }

 private:
  // Whatever it commands, or if that is nothing a motor knows.
  static bool Feeds(const Frame& frame) {
    const bool ours = frame.id == kCommands + kNode || frame.id == kAllMotors;
    return ours && !frame.extended && !frame.error && !frame.fd && !frame.remote &&
           frame.length == 8;
  }

  const RmdDevice::Settings settings_;
  RmdDevice device_;
  RmdDevice::Sample sample_;
  double zero_ = 0;
  int64_t now_ = MotorGame::kStart, fed_ = MotorGame::kStart;
};

}  // namespace
}  // namespace plumb

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  Bytes bytes({data, size});
  const uint8_t kind = bytes.Byte();
  // Of a direct drive and of one behind a great gear; what is stored of the watchdog may be
  // another.
  RmdDevice::Settings settings;
  settings.node = kNode;
  settings.torque_constant = (kind & 1) != 0 ? 0.5 : 7.5;
  settings.current = 20;
  settings.watchdog = kind % 5 * int64_t{50'000};
  MotorDescription description;
  description.protocol = "rmd";
  description.node = kNode;
  description.rmd = RmdDescription{.torque_constant = settings.torque_constant,
                                   .current = settings.current,
                                   .watchdog = 0.1,
                                   .source = "a test"};
  MotorGame(MakeRmdMotor(description, {200'000}), std::make_unique<Drive>(settings), bytes).Play();
  return 0;
}
