// libFuzzer: an ODrive's host and the virtual ODrive, see MotorGame.

#include <cmath>
#include <numbers>

#include "drivers/protocols/cansimple_device.h"
#include "drivers/protocols/cansimple_host.h"
#include "tests/fuzz/motor_game.h"

namespace plumb {
namespace {

using namespace cansimple;

constexpr int kNode = 1;
constexpr double kTurn = 2 * std::numbers::pi;

CanSimpleDevice::Settings Settings(uint8_t kind) {
  CanSimpleDevice::Settings settings;
  settings.node = kNode;
  settings.heartbeat_period = 40'000;
  settings.encoder_period = (kind & 1) != 0 ? 1000 : 2000;
  settings.torques_period = (kind & 2) != 0 ? 2000 : 0;
  settings.watchdog = (kind & 4) != 0 ? 20'000 : 0;
  settings.telemetry_period = (kind & 8) != 0 ? 100'000 : 0;
  return settings;
}

class Drive : public VirtualDrive {
 public:
  explicit Drive(uint8_t kind) : settings_(Settings(kind)), device_(settings_, MotorGame::kStart) {}

  std::vector<uint32_t> ids() const override {
    std::vector<uint32_t> ids;
    for (uint32_t command = 0; command < 32; ++command) ids.push_back(kNode << 5 | command);
    for (const Layout& layout : {kEstop, kAddress})
      ids.push_back(kBroadcastNode << 5 | layout.command);
    return ids;
  }
  void OnFrame(const Frame& frame, int64_t now) override {
    const int64_t setpoints = device_.setpoints(), rejected = device_.rejected();
    device_.OnFrame(frame, now);
    if (device_.setpoints() > setpoints) setpoint_ = *TorqueIn(frame);
    const uint32_t command = frame.id & 0x1F;
    if (command >= kSetInputPos.command && command <= kSetInputTorque.command &&
        device_.rejected() == rejected) {
      fed_ = now;
    }
  }
  void Tick(int64_t now, FrameBatch& out) override {
    device_.Tick(now, sample_, out);
    if (device_.Torque() == 0) return;
    Require(device_.Torque() == setpoint_);
    if (settings_.watchdog > 0) Require(now - fed_ < settings_.watchdog);
  }
  int64_t NextDue() const override { return device_.NextDue(); }
  bool armed() const override { return device_.armed(); }
  double Torque() const override { return device_.Torque(); }
  int64_t rejected() const override { return device_.rejected(); }

  void Surprise(Bytes& bytes, bool sane, int64_t now) override {
    const uint8_t what = bytes.Byte();
    if (what < 64) {
      device_.Reboot(now);
      sample_.position = 0;
    } else if (what < 128) {
      device_.set_bus_voltage(sane ? bytes.Modest(60) : bytes.Number());
    } else if (what < 192) {
      device_.set_temperature(sane ? bytes.Modest(200) : bytes.Number());
    }
  }
  void Heal() override {
    device_.set_bus_voltage(24);
    device_.set_temperature(25);
    sample_ = {};
  }
  void Move(Bytes& bytes, bool sane) override {
    sample_.velocity = sane ? bytes.Modest(50) : bytes.Number();
    if (!sane) sample_.position = bytes.Number();
  }
  void Turn(int64_t microseconds) override {
    sample_.position += sample_.velocity * static_cast<double>(microseconds) * 1e-6;
  }

  std::optional<double> TorqueIn(const Frame& frame) const override {
    const auto values = DecodePayload(kSetInputTorqueShort, frame);
    if (!values || frame.id != (kNode << 5 | kSetInputTorque.command)) return {};
    return (*values)[0];
  }
  double max_torque() const override { return std::numeric_limits<float>::max(); }
  double Rounding(double torque) const override { return 1e-7 * std::abs(torque) + 1e-44; }
  bool MayBeTold(const Frame& frame, DriveState state) const override {
    const auto is = [&](const Frame& expected) { return SameOnWire(frame, expected); };
    if (is(MakeRequest(kGetError, kNode)) || is(Make(kSetInputTorqueShort, kNode, {0})) ||
        is(Make(kSetAxisState, kNode, {kIdle})) || is(Make(kEstop, kNode))) {
      return true;
    }
    // To one that is silent: only the question who it is.
    if (state == DriveState::kAbsent) return is(MakeRequest(kGetVersion, kNode));
    return state == DriveState::kArming &&
           (is(MakeRequest(kGetVersion, kNode)) || is(Make(kClearErrors, kNode)) ||
            is(Make(kSetControllerMode, kNode, {kTorqueControl, kPassthrough})) ||
            is(Make(kSetAxisState, kNode, {kClosedLoopControl})));
  }
  bool Agrees(const MotorEstimate& estimate) const override {
    const auto near = [](double a, double b) {
      return std::abs(a - b) <= 1e-6 * (1 + std::abs(b));
    };
    return near(estimate.position, sample_.position * kTurn) &&
           near(estimate.velocity, sample_.velocity * kTurn);
  }

 private:
  const CanSimpleDevice::Settings settings_;
  CanSimpleDevice device_;
  CanSimpleDevice::Sample sample_;
  int64_t fed_ = MotorGame::kStart;
  double setpoint_ = 0;
};

}  // namespace
}  // namespace plumb

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  Bytes bytes({data, size});
  MotorDescription description;
  description.protocol = "cansimple";
  description.node = kNode;
  auto drive = std::make_unique<Drive>(bytes.Byte());
  MotorGame(MakeCanSimpleMotor(description, {200'000}), std::move(drive), bytes).Play();
  return 0;
}
