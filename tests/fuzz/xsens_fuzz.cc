// libFuzzer: an Xsens MTi's host and the virtual one, see SensorGame.

#include <cmath>

#include "drivers/protocols/xsens_device.h"
#include "drivers/protocols/xsens_host.h"
#include "tests/fuzz/sensor_game.h"

namespace plumb {
namespace {

using namespace xsens;

class Imu : public VirtualSensor {
 public:
  explicit Imu(const XsensDevice::Settings& settings)
      : base_(static_cast<uint32_t>(settings.base)), device_(settings, SensorGame::kStart) {}

  std::vector<uint32_t> ids() const override {
    std::vector<uint32_t> ids;
    for (const Layout& layout : {kError, kWarning, kSampleTime, kGroupCounter, kStatusWord,
                                 kQuaternion, kEulerAngles, kRateOfTurn, kAcceleration}) {
      ids.push_back(base_ + layout.command);
    }
    return ids;
  }
  void OnFrame(const Frame&, int64_t) override {}
  void Tick(int64_t now, FrameBatch& out) override { device_.Tick(now, sample_, out); }
  int64_t NextDue() const override { return device_.NextDue(); }
  int64_t rejected() const override { return 0; }

  void Surprise(Bytes& bytes, int64_t now) override {
    const uint8_t what = bytes.Byte();
    what < 128 ? device_.Reboot(now) : device_.Error(what);
  }
  void Heal() override { sample_ = {}; }
  void Move(Bytes& bytes, bool sane) override {
    const auto number = [&](double most) { return sane ? bytes.Modest(most) : bytes.Number(); };
    for (double& rate : sample_.rate) rate = number(60);
    for (double& force : sample_.force) force = number(120);
    for (double& q : sample_.orientation) q = number(1);
    double square = 0;
    for (const double q : sample_.orientation) square += q * q;
    if (sane && square > 0.01) {
      for (double& q : sample_.orientation) q /= std::sqrt(square);
    }
    sample_.status = bytes.Value<uint32_t>();
  }
  void Turn(int64_t) override {}
  bool Agrees(const Sensor& host) const override {
    const ImuSample& imu = *host.imu();
    const auto near = [](double a, double b, double most) { return std::abs(a - b) <= most; };
    bool same = true;
    for (size_t i = 0; i < 3; ++i) {
      same = same && near(imu.rate[i], sample_.rate[i], 0.501 / 512) &&
             near(imu.force[i], sample_.force[i], 0.501 / 256);
    }
    for (size_t i = 0; i < 4 && imu.orientation_valid; ++i) {
      same = same && near(imu.orientation[i], sample_.orientation[i], 2e-3);
    }
    // The word may say of which axes, or only that there are some.
    const uint32_t axes = sample_.status & (kForceAxes | kRateAxes | kFieldAxes);
    const bool some = (sample_.status & kClippingDetected) != 0 && axes == 0;
    return same && imu.rate_clipped == (some || (axes & kRateAxes) != 0) &&
           imu.force_clipped == (some || (axes & kForceAxes) != 0);
  }

 private:
  const uint32_t base_;
  XsensDevice device_;
  XsensDevice::Sample sample_;
};

}  // namespace
}  // namespace plumb

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  Bytes bytes({data, size});
  const uint8_t kind = bytes.Byte();
  XsensDevice::Settings settings;
  settings.base = (kind & 1) != 0 ? 0x700 : 0;
  settings.period = (kind & 2) != 0 ? 10'000 : 5'000;
  settings.group_counter = (kind & 4) != 0;
  settings.first_tick = (kind & 8) != 0 ? 0xFFFFFF00 : 0;
  SensorDescription description;
  description.name = "imu";
  description.protocol = "xsens";
  description.base = settings.base;
  description.period = static_cast<double>(settings.period) * 1e-6;
  SensorGame(MakeXsensImu(description, {100'000}), std::make_unique<Imu>(settings), bytes).Play();
  return 0;
}
