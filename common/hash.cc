#include "common/hash.h"

#include <array>
#include <bit>

namespace plumb {
namespace {

constexpr uint64_t kPrime = 0x100000001b3;

}  // namespace

uint64_t Hash(const void* data, size_t size, uint64_t from) {
  const auto* bytes = static_cast<const unsigned char*>(data);
  for (size_t i = 0; i < size; ++i) from = (from ^ bytes[i]) * kPrime;
  return from;
}

uint64_t Hash(std::string_view text, uint64_t from) { return Hash(text.data(), text.size(), from); }

uint64_t Hash(const Eigen::MatrixXd& matrix, uint64_t from) {
  const std::array<int64_t, 2> shape{matrix.rows(), matrix.cols()};
  from = Hash(shape.data(), sizeof shape, from);
  for (const double entry : matrix.reshaped()) {
    from = (from ^ std::bit_cast<uint64_t>(entry)) * kPrime;
    // A product's low bits know nothing of the factors' high ones: two signs that change would
    // otherwise make the same hash.
    from ^= from >> 32;
  }
  return from;
}

}  // namespace plumb
