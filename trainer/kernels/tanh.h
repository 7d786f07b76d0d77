#pragma once

#include <cstring>

#include "common/packet.h"

namespace plumb::kernels {

/// tanh to 2e-7 absolute: 1 - 2 / (e^(2x) + 1), with e^(2x) = 2^n 2^f, n an integer, |f| <= 1/2,
/// and 2^f by its Taylor polynomial of degree 6, whose error of 1.2e-7 is halved by the division.
/// NaN gives NaN. Thread-safe.
inline Packet Tanh(Packet x) {
  constexpr float kSaturated = 10.0f;  // 1 - tanh(10) = 4e-9, nothing beside 1
  x = x > kSaturated ? kSaturated + Packet{} : x;
  x = x < -kSaturated ? -kSaturated + Packet{} : x;
  const Packet y = x * 2.8853900817779268f;  // 2 log2(e) x
  // Adding 1.5 * 2^23 rounds to an integer, which is then in the low bits of the sum's
  // representation.
  constexpr float kRounder = 12582912.0f;
  const Packet rounded = y + kRounder;
  const Packet f = y - (rounded - kRounder);
  Packet power = 1.5403530e-4f + Packet{};  // ln(2)^6 / 6!
  power = power * f + 1.3333558e-3f;        // ln(2)^5 / 5!
  power = power * f + 9.6181291e-3f;
  power = power * f + 5.5504109e-2f;
  power = power * f + 2.4022651e-1f;
  power = power * f + 6.9314718e-1f;
  power = power * f + 1.0f;
  IntPacket exponent;
  std::memcpy(&exponent, &rounded, sizeof exponent);
  exponent = (exponent << 23) + (127 << 23);
  Packet scale;
  std::memcpy(&scale, &exponent, sizeof scale);
  return 1.0f - 2.0f / (power * scale + 1.0f);
}

}  // namespace plumb::kernels
