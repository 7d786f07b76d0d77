#include "trainer/kernels/matrix.h"

#include <algorithm>
#include <cassert>
#include <cstdlib>
#include <cstring>
#include <new>

namespace plumb::kernels {
namespace {

constexpr size_t kCacheLine = 64;
constexpr ptrdiff_t kLineFloats = kCacheLine / sizeof(float);

// A tile of C is kTileRows packets times kTileColumns and lives in registers during its sum: 12
// accumulators, the packets of A and one of B are what 16 registers hold, twice as many what
// AVX-512's 32 do.
#if defined(__AVX512F__)
constexpr int kTileRows = 2;
constexpr int kTileColumns = 12;
#elif defined(__AVX__)
constexpr int kTileRows = 2;
constexpr int kTileColumns = 6;
#else
constexpr int kTileRows = 2;
constexpr int kTileColumns = 4;
#endif
// A single column has too few sums in flight to hide the latency of their additions: it takes
// taller tiles.
constexpr int kTallRows = 8;

struct Problem {
  int k;
  LeftFactor a;
  RightFactor b;
  ptrdiff_t c_stride;
  Onto onto;
};

/// Not to be inlined: among the surrounding loops GCC 12 runs out of registers and keeps half of
/// `sum` in memory.
template <int kRows, int kColumns>
__attribute__((noinline)) void Tile(const Problem& problem, const float* a, const float* b,
                                    float* c, const float* bias) {
  Packet sum[kColumns][kRows];
#pragma GCC unroll 16
  for (int j = 0; j < kColumns; ++j) {
#pragma GCC unroll 8
    for (int i = 0; i < kRows; ++i) {
      sum[j][i] = problem.onto == Onto::kItself ? Load(c + j * problem.c_stride + i * kWidth)
                  : problem.onto == Onto::kBias ? Load(bias + i * kWidth)
                                                : Packet{};
    }
  }
  for (int l = 0; l < problem.k; ++l) {
    Packet left[kRows];
#pragma GCC unroll 8
    for (int i = 0; i < kRows; ++i) left[i] = Load(a + i * kWidth);
#pragma GCC unroll 16
    for (int j = 0; j < kColumns; ++j) {
      const float right = b[j * problem.b.column_stride];
#pragma GCC unroll 8
      for (int i = 0; i < kRows; ++i) sum[j][i] += left[i] * right;
    }
    a += problem.a.stride;
    b += problem.b.row_stride;
  }
#pragma GCC unroll 16
  for (int j = 0; j < kColumns; ++j) {
#pragma GCC unroll 8
    for (int i = 0; i < kRows; ++i) Store(c + j * problem.c_stride + i * kWidth, sum[j][i]);
  }
}

/// The columns that are left when no whole tile fits any more.
template <int kRows, int kColumns>
void Remainder(int columns, const Problem& problem, const float* a, const float* b, float* c,
               const float* bias) {
  if constexpr (kColumns > 0) {
    if (columns == kColumns) {
      Tile<kRows, kColumns>(problem, a, b, c, bias);
    } else {
      Remainder<kRows, kColumns - 1>(columns, problem, a, b, c, bias);
    }
  }
}

/// A band of kRows packets of C, from left to right: its rows of A stay in the first-level cache.
template <int kRows, int kColumns>
void Band(int n, const Problem& problem, const float* a, float* c, const float* bias) {
  int j = 0;
  for (; j + kColumns <= n; j += kColumns) {
    Tile<kRows, kColumns>(problem, a, problem.b.data + j * problem.b.column_stride,
                          c + j * problem.c_stride, bias);
  }
  Remainder<kRows, kColumns - 1>(n - j, problem, a, problem.b.data + j * problem.b.column_stride,
                                 c + j * problem.c_stride, bias);
}

template <int kRows, int kColumns>
int Bands(int i, int m, int n, const Problem& problem, float* c, const float* bias) {
  for (; i + kRows * kWidth <= m; i += kRows * kWidth) {
    Band<kRows, kColumns>(n, problem, problem.a.data + i, c + i, bias ? bias + i : nullptr);
  }
  return i;
}

}  // namespace

Matrix::Matrix(int rows, int columns) : rows_(rows), columns_(columns) {
  const ptrdiff_t lines = (padded_rows() + kLineFloats - 1) / kLineFloats;
  stride_ = (lines | 1) * kLineFloats;
  const size_t bytes =
      static_cast<size_t>(stride_) * static_cast<size_t>(std::max(columns, 1)) * sizeof(float);
  data_.reset(static_cast<float*>(std::aligned_alloc(kCacheLine, bytes)));
  if (!data_) throw std::bad_alloc();
  SetZero();
}

void Matrix::SetZero() {
  std::memset(data_.get(), 0,
              static_cast<size_t>(stride_) * static_cast<size_t>(columns_) * sizeof(float));
}

void Matrix::Free::operator()(float* data) const { std::free(data); }

void Multiply(int m, int n, int k, LeftFactor a, RightFactor b, float* c, ptrdiff_t c_stride,
              Onto onto, const float* bias) {
  assert(onto != Onto::kBias || bias);
  const Problem problem{k, a, b, c_stride, onto};
  if (n == 1) {
    const int i = Bands<kTallRows, 1>(0, m, n, problem, c, bias);
    Bands<1, 1>(i, m, n, problem, c, bias);
  } else {
    const int i = Bands<kTileRows, kTileColumns>(0, m, n, problem, c, bias);
    Bands<1, kTileColumns>(i, m, n, problem, c, bias);
  }
}

namespace {

// A scalar product is eight sums side by side, however many a register holds: its bits are the same
// at all levels that fuse multiplications and additions.
constexpr int kSums = 8;
using Sums = float __attribute__((vector_size(kSums * sizeof(float))));

Sums LoadSums(const float* from) {
  Sums sums;
  std::memcpy(&sums, from, sizeof sums);
  return sums;
}

/// Each of the first half and its counterpart of the second, and so on.
float Total(Sums sums) {
  float entries[kSums];
  std::memcpy(entries, &sums, sizeof sums);
  for (int half = kSums / 2; half > 0; half /= 2) {
    for (int i = 0; i < half; ++i) entries[i] += entries[i + half];
  }
  return entries[0];
}

/// a b + c, rounded once where that can be. Said so, as the compiler multiplies several at a time
/// where sums have to be taken in order, and then does not fuse them.
float MultiplyAdd(float a, float b, float c) {
#if defined(__FMA__)
  return __builtin_fmaf(a, b, c);
#else
  return a * b + c;
#endif
}

/// kColumns scalar products at a time: their sums do not wait for each other.
template <int kColumns>
void ScalarProducts(int k, const float* a, const float* b, ptrdiff_t b_stride, float* products) {
  Sums sums[kColumns] = {};
  int l = 0;
  for (; l + kSums <= k; l += kSums) {
    const Sums left = LoadSums(a + l);
#pragma GCC unroll 8
    for (int j = 0; j < kColumns; ++j) sums[j] += left * LoadSums(b + j * b_stride + l);
  }
#pragma GCC unroll 8
  for (int j = 0; j < kColumns; ++j) products[j] = Total(sums[j]);
  // Not the padding: where an entry above it is infinite it is no zero.
  for (; l < k; ++l) {
    for (int j = 0; j < kColumns; ++j)
      products[j] = MultiplyAdd(a[l], b[j * b_stride + l], products[j]);
  }
}

}  // namespace

void MultiplyFewRows(int rows, int n, const Matrix& transposed, const float* b, ptrdiff_t b_stride,
                     float* c, ptrdiff_t c_stride, Onto onto, const float* bias) {
  constexpr int kTogether = 8;
  const int k = transposed.rows();
  for (int i = 0; i < rows; ++i) {
    const float* a = transposed.column(i);
    const auto add = [&](int j, const float* products, int count) {
      for (int m = 0; m < count; ++m) {
        float& to = c[(j + m) * c_stride + i];
        to = products[m] + (onto == Onto::kItself ? to : onto == Onto::kBias ? bias[i] : 0.0f);
      }
    };
    float products[kTogether];
    int j = 0;
    for (; j + kTogether <= n; j += kTogether) {
      ScalarProducts<kTogether>(k, a, b + j * b_stride, b_stride, products);
      add(j, products, kTogether);
    }
    for (; j < n; ++j) {
      ScalarProducts<1>(k, a, b + j * b_stride, b_stride, products);
      add(j, products, 1);
    }
  }
}

void Transpose(const Matrix& from, Matrix& to) {
  // Squares of 4 by 4 in registers.
  using Quad = float __attribute__((vector_size(16)));
  const auto load = [](const float* data) {
    Quad quad;
    std::memcpy(&quad, data, sizeof quad);
    return quad;
  };
  int j = 0;
  for (; j + 4 <= from.columns(); j += 4) {
    int i = 0;
    for (; i + 4 <= from.rows(); i += 4) {
      const Quad a = load(from.column(j) + i), b = load(from.column(j + 1) + i);
      const Quad c = load(from.column(j + 2) + i), d = load(from.column(j + 3) + i);
      const Quad ab_low = __builtin_shufflevector(a, b, 0, 4, 1, 5),
                 ab_high = __builtin_shufflevector(a, b, 2, 6, 3, 7);
      const Quad cd_low = __builtin_shufflevector(c, d, 0, 4, 1, 5),
                 cd_high = __builtin_shufflevector(c, d, 2, 6, 3, 7);
      const Quad row[4] = {__builtin_shufflevector(ab_low, cd_low, 0, 1, 4, 5),
                           __builtin_shufflevector(ab_low, cd_low, 2, 3, 6, 7),
                           __builtin_shufflevector(ab_high, cd_high, 0, 1, 4, 5),
                           __builtin_shufflevector(ab_high, cd_high, 2, 3, 6, 7)};
      for (int k = 0; k < 4; ++k) std::memcpy(to.column(i + k) + j, &row[k], sizeof row[k]);
    }
    for (; i < from.rows(); ++i) {
      for (int k = 0; k < 4; ++k) to.column(i)[j + k] = from.column(j + k)[i];
    }
  }
  for (; j < from.columns(); ++j) {
    for (int i = 0; i < from.rows(); ++i) to.column(i)[j] = from.column(j)[i];
  }
}

}  // namespace plumb::kernels
