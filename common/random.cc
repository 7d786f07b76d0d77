#include "common/random.h"

#include <Random123/philox.h>

#include <cmath>
#include <stdexcept>

namespace plumb {

Random::Random(uint64_t seed, std::initializer_list<uint32_t> stream)
    : counter_{}, key_{static_cast<uint32_t>(seed), static_cast<uint32_t>(seed >> 32)} {
  if (stream.size() > 3) throw std::invalid_argument("Random: at most three stream words");
  size_t i = 1;
  for (const uint32_t word : stream) counter_[i++] = word;
}

uint32_t Random::Bits() {
  if (used_ == 4) {
    const r123::Philox4x32 philox;
    const r123::Philox4x32::ctr_type counter{{counter_[0], counter_[1], counter_[2], counter_[3]}};
    const r123::Philox4x32::key_type key{{key_[0], key_[1]}};
    const auto block = philox(counter, key);
    for (size_t i = 0; i < 4; ++i) block_[i] = block[i];
    ++counter_[0];
    used_ = 0;
  }
  return block_[static_cast<size_t>(used_++)];
}

double Random::Uniform() {
  const uint64_t high = Bits() >> 5, low = Bits() >> 6;
  return static_cast<double>((high << 26) | low) * 0x1p-53;
}

double Random::Normal() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  const double radius = std::sqrt(-2 * std::log1p(-Uniform()));
  const double angle = 2 * M_PI * Uniform();
  spare_ = radius * std::sin(angle);
  has_spare_ = true;
  return radius * std::cos(angle);
}

}  // namespace plumb
