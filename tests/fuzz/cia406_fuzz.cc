// libFuzzer: a CANopen encoder's host and the virtual encoder, see SensorGame.

#include <cmath>
#include <numbers>

#include "drivers/protocols/cia406_device.h"
#include "drivers/protocols/cia406_host.h"
#include "tests/fuzz/sensor_game.h"

namespace plumb {
namespace {

using namespace cia406;

constexpr int kNode = 1;
constexpr double kTurn = 2 * std::numbers::pi;

class Encoder : public VirtualSensor {
 public:
  explicit Encoder(const Cia406Device::Settings& settings)
      : settings_(settings), device_(settings, SensorGame::kStart) {}

  std::vector<uint32_t> ids() const override {
    std::vector<uint32_t> ids{kNmt.command};
    for (const Layout& layout : {kEmergency, kPosition, kSdoAnswer, kSdoRequest, kHeartbeat}) {
      ids.push_back(layout.command + kNode);
    }
    return ids;
  }
  void OnFrame(const Frame& frame, int64_t now) override { device_.OnFrame(frame, now); }
  void Tick(int64_t now, FrameBatch& out) override { device_.Tick(now, position_, out); }
  int64_t NextDue() const override { return device_.NextDue(); }
  int64_t rejected() const override { return device_.rejected(); }

  void Surprise(Bytes& bytes, int64_t now) override {
    const uint8_t what = bytes.Byte();
    what < 128 ? device_.Reboot(now) : device_.Emergency(bytes.Value<uint16_t>());
  }
  void Heal() override { position_ = velocity_ = 0; }
  void Move(Bytes& bytes, bool sane) override {
    velocity_ = sane ? bytes.Modest(kMaxSpeed) : bytes.Number();
    if (!sane) position_ = bytes.Number();
  }
  void Turn(int64_t microseconds) override {
    position_ += velocity_ * static_cast<double>(microseconds) * 1e-6;
  }
  bool Agrees(const Sensor& host) const override {
    const double count = kTurn / settings_.counts;
    const double difference =
        std::remainder(host.encoder()->position - position_, settings_.range * count);
    return std::abs(difference) <= count * 1.01 + 1e-9 * std::abs(position_);
  }

  static constexpr double kMaxSpeed = 20;  // [rad/s]

 private:
  const Cia406Device::Settings settings_;
  Cia406Device device_;
  double position_ = 0, velocity_ = 0;
};

}  // namespace
}  // namespace plumb

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  Bytes bytes({data, size});
  const uint8_t kind = bytes.Byte();
  Cia406Device::Settings settings;
  settings.node = kNode;
  settings.heartbeat_period = (kind & 1) != 0 ? 100'000 : 0;
  settings.counts = (kind & 2) != 0 ? 65536 : 1000;
  settings.range = (kind & 4) != 0 ? 4294967296. : settings.counts;
  SensorDescription description;
  description.name = "boom";
  description.protocol = "cia406";
  description.node = kNode;
  description.counts = settings.counts;
  description.range = settings.range;
  description.period = (kind & 8) != 0 ? 0.002 : 0.01;
  description.max_speed = Encoder::kMaxSpeed;
  SensorGame(MakeCia406Encoder(description, {100'000}), std::make_unique<Encoder>(settings), bytes)
      .Play();
  return 0;
}
