#include "common/hash.h"

#include <array>

namespace plumb {

uint64_t Hash(const void* data, size_t size, uint64_t from) {
  const auto* bytes = static_cast<const unsigned char*>(data);
  for (size_t i = 0; i < size; ++i) from = (from ^ bytes[i]) * 0x100000001b3;
  return from;
}

uint64_t Hash(std::string_view text, uint64_t from) { return Hash(text.data(), text.size(), from); }

uint64_t Hash(const Eigen::MatrixXd& matrix, uint64_t from) {
  const std::array<int64_t, 2> shape{matrix.rows(), matrix.cols()};
  return Hash(matrix.data(), static_cast<size_t>(matrix.size()) * sizeof(double),
              Hash(shape.data(), sizeof shape, from));
}

}  // namespace plumb
