// libFuzzer: a MIT motor's host and the virtual motor, see MotorGame.

#include <cmath>

#include "drivers/protocols/mit_device.h"
#include "drivers/protocols/mit_host.h"
#include "tests/fuzz/motor_game.h"

namespace plumb {
namespace {

using namespace mit;

constexpr int kNode = 0x11, kMaster = 0x10;

MitRanges Ranges(uint8_t kind) {
  // Of an AK80-6, and the narrowest and widest that one would configure.
  static constexpr MitRanges kRanges[] = {
      {12.5, 50, 18, 500, 5}, {4, 0.5, 0.1, 500, 5}, {95.5, 1000, 144, 500, 5}};
  return kRanges[kind % std::size(kRanges)];
}

bool IsSpecial(const Frame& frame) {
  return frame.length == 8 && frame.data[7] >= kEnter &&
         std::all_of(frame.data.begin(), frame.data.begin() + 7,
                     [](uint8_t byte) { return byte == 0xFF; });
}

class Drive : public VirtualDrive {
 public:
  explicit Drive(const MitDevice::Settings& settings)
      : settings_(settings), command_(CommandLayout(settings.ranges)), device_(settings) {}

  std::vector<uint32_t> ids() const override { return {kNode, kMaster}; }
  void OnFrame(const Frame& frame, int64_t now) override {
    const int64_t rejected = device_.rejected();
    const bool armed = device_.armed();
    device_.OnFrame(frame, now);
    const bool command = frame.id == kNode && device_.rejected() == rejected && !IsSpecial(frame);
    // The watchdog of a command given at rest runs from the moment it is switched on.
    if (command || device_.armed() != armed) fed_ = now;
  }
  void Tick(int64_t now, FrameBatch& out) override {
    device_.Tick(now, sample_, out);
    if (settings_.watchdog > 0 && now - fed_ >= settings_.watchdog)
      Require(device_.Torque(sample_) == 0);
  }
  int64_t NextDue() const override { return device_.NextDue(); }
  bool armed() const override { return device_.armed(); }
  double Torque() const override { return device_.Torque(sample_); }
  int64_t rejected() const override { return device_.rejected(); }

  void Surprise(Bytes& bytes, bool, int64_t) override {
    const uint8_t what = bytes.Byte();
    if (what < 64) {
      device_.Reboot(sample_.position);
      zero_ = sample_.position;
    } else {
      device_.set_error(static_cast<Error>(what % 8));
    }
  }
  void Heal() override {
    device_.set_error(kNoError);
    device_.Reboot(0);
    sample_ = {};
    zero_ = 0;
  }
  void Move(Bytes& bytes, bool sane) override {
    sample_.velocity = sane ? bytes.Modest(0.99 * Slowest()) : bytes.Number();
    if (!sane) sample_.position = bytes.Number();
  }
  void Turn(int64_t microseconds) override {
    sample_.position += sample_.velocity * static_cast<double>(microseconds) * 1e-6;
  }

  std::optional<double> TorqueIn(const Frame& frame) const override {
    if (frame.id != kNode || frame.length != 8 || IsSpecial(frame)) return {};
    const FieldValues v = *DecodePayload(command_, frame);
    if (v[2] != 0 || v[3] != 0) return {};
    return v[4];
  }
  double max_torque() const override { return settings_.ranges.torque; }
  double Rounding(double) const override { return 1.001 * settings_.ranges.torque / 4095; }
  bool MayBeTold(const Frame& frame, DriveState state) const override {
    return SameOnWire(frame, MakeSpecial(kNode, kExit)) ||
           SameOnWire(frame, MakeCommand(command_, kNode, {})) ||
           (state == DriveState::kArming && SameOnWire(frame, MakeSpecial(kNode, kEnter)));
  }
  bool Agrees(const MotorEstimate& estimate) const override {
    const double position = sample_.position - zero_;
    if (std::abs(position) > 1e5) return true;  // where single precision has no more codes
    const double difference =
        std::remainder(estimate.position - position, Period(settings_.ranges));
    // A code is cut off, in single precision.
    return std::abs(difference) <= Period(settings_.ranges) / 65535 + 1e-6 * std::abs(position) &&
           std::abs(estimate.velocity - sample_.velocity) <= 2.1 * settings_.ranges.velocity / 4095;
  }

 private:
  /// [rad/s] It must not go round half its period while one may be silent.
  double Slowest() const {
    return std::min(settings_.ranges.velocity, 2 * settings_.ranges.position);
  }

  const MitDevice::Settings settings_;
  const Layout command_;
  MitDevice device_;
  MitDevice::Sample sample_;
  double zero_ = 0;
  int64_t fed_ = MotorGame::kStart;
};

}  // namespace
}  // namespace plumb

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  Bytes bytes({data, size});
  const uint8_t kind = bytes.Byte();
  MitDevice::Settings settings;
  settings.node = kNode;
  settings.master = kMaster;
  settings.ranges = Ranges(kind >> 4);
  settings.reply_length = static_cast<uint8_t>(6 + kind % 3);
  settings.watchdog = (kind & 8) != 0 ? 25'000 : 0;
  MotorDescription description;
  description.protocol = "mit";
  description.node = kNode;
  description.mit = MitDescription{kMaster, settings.ranges, "a test"};
  MotorGame(MakeMitMotor(description, {200'000}), std::make_unique<Drive>(settings), bytes).Play();
  return 0;
}
