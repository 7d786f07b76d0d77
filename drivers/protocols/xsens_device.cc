#include "drivers/protocols/xsens_device.h"

#include <array>
#include <cmath>
#include <stdexcept>

#include "common/time_units.h"

namespace plumb {

using namespace xsens;

namespace {

// The bits of the axes on which there is more than the message can say.
uint32_t Beyond(const Layout& layout, const std::array<double, 3>& values, uint32_t first_axis) {
  uint32_t bits = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    if (!layout.fields[i].Holds(values[i])) bits |= first_axis << i;
  }
  return bits;
}

class Imu : public SensorDevice {
 public:
  explicit Imu(const XsensDevice::Settings& settings) : settings_(settings), device_(settings, 0) {}

  std::vector<Filter> filters() const override { return {}; }
  void OnFrame(const Frame&, int64_t) override {}
  void Tick(int64_t now, const SensedMotion& motion, FrameBatch& out) override {
    device_.Tick(
        now, {.rate = motion.rate, .force = motion.force, .orientation = motion.orientation}, out);
  }
  int64_t NextDue() const override { return device_.NextDue(); }
  void Boot(int64_t now) override { device_ = XsensDevice(settings_, now); }

 private:
  XsensDevice::Settings settings_;
  XsensDevice device_;
};

}  // namespace

XsensDevice::XsensDevice(const Settings& settings, int64_t now) : settings_(settings) {
  if (settings.period <= 0 || settings.tick <= 0) {
    throw std::invalid_argument("an IMU needs a period and a tick");
  }
  Reboot(now);
}

void XsensDevice::Reboot(int64_t now) noexcept {
  started_ = now;
  next_ = now - now % settings_.period + settings_.period;
  counter_ = 0;
}

void XsensDevice::Tick(int64_t now, const Sample& sample, FrameBatch& out) noexcept {
  const int base = settings_.base;
  if (error_ != 0) out.Push(Make(kError, base, {double(error_)}));
  error_ = 0;
  if (now < next_) return;
  next_ = now - now % settings_.period + settings_.period;
  const auto ticks =
      settings_.first_tick + static_cast<uint32_t>((now - started_) / settings_.tick);
  const auto& [w, x, y, z] = sample.orientation;
  out.Push(Make(kSampleTime, base, {double(ticks)}));
  if (settings_.group_counter) out.Push(Make(kGroupCounter, base, {double(counter_++)}));
  const uint32_t status = sample.status | Beyond(kAcceleration, sample.force, kClippedForce) |
                          Beyond(kRateOfTurn, sample.rate, kClippedRate);
  out.Push(Make(kStatusWord, base, {double(status)}));
  out.Push(Make(kQuaternion, base, {w, x, y, z}));
  out.Push(Make(kRateOfTurn, base, {sample.rate[0], sample.rate[1], sample.rate[2]}));
  out.Push(Make(kAcceleration, base, {sample.force[0], sample.force[1], sample.force[2]}));
}

std::unique_ptr<SensorDevice> MakeXsensDevice(const SensorDescription& sensor) {
  return std::make_unique<Imu>(XsensDevice::Settings{.base = sensor.base,
                                                     .period = Microseconds(sensor.period),
                                                     .tick = Microseconds(sensor.tick)});
}

}  // namespace plumb
