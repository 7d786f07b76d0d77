#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

/// One vector register of floats, as wide as the compiler's target has them. For the insides of
/// libraries that are built once per level of instruction set (plumb_levels), never for their
/// interfaces: compiled for another level it is another type. Thread-safe.

namespace plumb::kernels {

#if defined(__AVX512F__)
inline constexpr ptrdiff_t kWidth = 16;
#elif defined(__AVX__)
inline constexpr ptrdiff_t kWidth = 8;
#else
inline constexpr ptrdiff_t kWidth = 4;
#endif

using Packet = float __attribute__((vector_size(kWidth * sizeof(float))));
using IntPacket = int32_t __attribute__((vector_size(kWidth * sizeof(int32_t))));

inline Packet Load(const float* from) {
  Packet packet;
  std::memcpy(&packet, from, sizeof packet);
  return packet;
}

inline void Store(float* to, Packet packet) { std::memcpy(to, &packet, sizeof packet); }

}  // namespace plumb::kernels
