#include "common/exponential.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>

namespace plumb {
namespace {

// Two side by side, as every x86-64 has them; operators are one IEEE operation for each.
using Pair = double __attribute__((vector_size(16)));
using Bits = int64_t __attribute__((vector_size(16)));

constexpr int kPairs = 4;  // at a time: each waits for its own sums only

void Exp(Pair* x) {
  constexpr double kLog2E = 1.44269504088896338700;
  // ln 2 = first + second; the first has 33 bits, so that k times it is exact. fdlibm's e_exp.c.
  constexpr double kFirst = 6.93147180369123816490e-01, kSecond = 1.90821492927058770002e-10;
  constexpr double kRound = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to an integer
  // 1 / n! of n = 10 down to 0; the rest is less than (ln 2 / 2)^11 / 11! = 2.2e-13
  constexpr double kSeries[] = {1. / 3628800, 1. / 362880, 1. / 40320, 1. / 5040,
                                1. / 720,     1. / 120,    1. / 24,    1. / 6,
                                0.5,          1,           1};
  const Pair least{-700, -700};
  Pair shifted[kPairs], r[kPairs], sum[kPairs] = {};
#pragma GCC unroll 4
  for (int i = 0; i < kPairs; ++i) {
    const Pair above = x[i] < least ? least : x[i];
    shifted[i] = above * kLog2E + kRound;
    const Pair k = shifted[i] - kRound;
    r[i] = (above - k * kFirst) - k * kSecond;
  }
#pragma GCC unroll 11
  for (const double term : kSeries) {
#pragma GCC unroll 4
    for (int i = 0; i < kPairs; ++i) sum[i] = sum[i] * r[i] + term;
  }
#pragma GCC unroll 4
  for (int i = 0; i < kPairs; ++i) {
    // the lowest bits of `shifted` are k's
    x[i] = sum[i] * std::bit_cast<Pair>((std::bit_cast<Bits>(shifted[i]) + 1023) << 52);
  }
}

}  // namespace

void ExpOfNegatives(std::span<double> x) {
  constexpr size_t kBlock = 2 * kPairs;
  for (size_t i = 0; i < x.size(); i += kBlock) {
    const size_t bytes = std::min(kBlock, x.size() - i) * sizeof(double);
    Pair block[kPairs] = {};
    std::memcpy(block, &x[i], bytes);
    Exp(block);
    std::memcpy(&x[i], block, bytes);
  }
}

}  // namespace plumb
