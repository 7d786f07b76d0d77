#include "common/hash.h"

#include <array>
#include <bit>

namespace plumb {
namespace {

// MurmurHash3's fmix64 (Appleby, 2011, public domain): each bit of x moves half of the result's.
uint64_t Mix(uint64_t x) {
  x = (x ^ x >> 33) * 0xff51afd7ed558ccd;
  x = (x ^ x >> 33) * 0xc4ceb9fe1a85ec53;
  return x ^ x >> 33;
}

}  // namespace

uint64_t Hash(const void* data, size_t size, uint64_t from) {
  const auto* bytes = static_cast<const unsigned char*>(data);
  for (size_t i = 0; i < size; ++i) from = (from ^ bytes[i]) * 0x100000001b3;
  return from;
}

uint64_t Hash(std::string_view text, uint64_t from) { return Hash(text.data(), text.size(), from); }

uint64_t Hash(const Eigen::MatrixXd& matrix, uint64_t from) {
  const std::array<int64_t, 2> shape{matrix.rows(), matrix.cols()};
  from = Hash(shape.data(), sizeof shape, from);
  for (const double entry : matrix.reshaped()) from = Mix(from ^ std::bit_cast<uint64_t>(entry));
  return from;
}

}  // namespace plumb
