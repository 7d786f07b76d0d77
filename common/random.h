#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <utility>
#include <vector>

namespace plumb {

/// Counter-based random numbers: Philox4x32-10 (Salmon et al., "Parallel random numbers: as easy as
/// 1, 2, 3", SC 2011; Random123). A generator is named by a seed and up to three stream words, such
/// as (iteration, sample): equal names give equal numbers in any thread, process or resumed run.
/// Not thread-safe; cheap to construct and copy.
class Random {
 public:
  /// @throws std::invalid_argument for more than three stream words.
  explicit Random(uint64_t seed, std::initializer_list<uint32_t> stream = {});

  /// 32 uniform random bits.
  uint32_t Bits();
  /// Uniform in [0, 1), 53 bits.
  double Uniform();
  /// Uniform in [lower, upper).
  double Uniform(double lower, double upper) { return lower + (upper - lower) * Uniform(); }
  /// One of 0, 1, ... bound - 1, bound > 0.
  size_t Below(size_t bound) { return static_cast<size_t>(Uniform() * static_cast<double>(bound)); }
  /// Standard normal (Box-Muller).
  double Normal();

 private:
  std::array<uint32_t, 4> counter_;  // word 0 counts blocks, words 1-3 are the stream
  std::array<uint32_t, 2> key_;
  std::array<uint32_t, 4> block_{};
  int used_ = 4;
  double spare_ = 0;
  bool has_spare_ = false;
};

/// Every order equally likely (Fisher and Yates).
template <class T>
void Shuffle(std::vector<T>& items, Random& random) {
  for (size_t i = items.size(); i > 1; --i) std::swap(items[i - 1], items[random.Below(i)]);
}

}  // namespace plumb
