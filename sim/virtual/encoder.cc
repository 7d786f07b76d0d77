#include "sim/virtual/encoder.h"

#include <cmath>

#include "common/time_units.h"

namespace plumb {

double ShaftMotion::Position(int64_t time) const {
  if (end == begin) return end_position;
  const double h = Seconds(end - begin);
  const double s = Seconds(time - begin) / h;
  // Hermite's basis.
  return (1 + 2 * s) * (1 - s) * (1 - s) * begin_position + s * s * (3 - 2 * s) * end_position +
         h * s * (1 - s) * ((1 - s) * begin_velocity - s * end_velocity);
}

Encoder::Encoder(int bits) : counts_(std::ldexp(1.0, bits)) {}

void Encoder::Reset(double position, double velocity) {
  position_ = position;
  velocity_ = velocity;
}

void Encoder::Track(const ShaftMotion& motion) {
  constexpr double kDt = kPeriod * 1e-6;
  constexpr double kProportional = 2 * kBandwidth;
  constexpr double kIntegral = kProportional * kProportional / 4;
  for (int64_t time = (motion.begin / kPeriod + 1) * kPeriod; time <= motion.end; time += kPeriod) {
    position_ += kDt * velocity_;
    const double error = Quantise(motion.Position(time)) - position_;
    position_ += kDt * kProportional * error;
    velocity_ += kDt * kIntegral * error;
  }
}

double Encoder::Quantise(double position) const { return std::round(position * counts_) / counts_; }

}  // namespace plumb
