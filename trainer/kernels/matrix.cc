#include "trainer/kernels/matrix.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <new>

namespace plumb::kernels {
namespace {

constexpr size_t kCacheLine = 64;
constexpr ptrdiff_t kLineFloats = kCacheLine / sizeof(float);

// A tile of C is kTileRows packets times kTileColumns and lives in registers during its sum: 12 accumulators,
// the packets of A and one of B are what 16 registers hold, twice as many what AVX-512's 32 do.
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
// A single column has too few sums in flight to hide the latency of their additions: it takes taller tiles.
constexpr int kTallRows = 8;

struct Problem {
  int k;
  LeftFactor a;
  RightFactor b;
  ptrdiff_t c_stride;
  Onto onto;
};

/// Not to be inlined: among the surrounding loops GCC 12 runs out of registers and keeps half of `sum` in
/// memory.
template <int kRows, int kColumns>
__attribute__((noinline)) void Tile(const Problem& problem, const float* a, const float* b, float* c,
                                    const float* bias) {
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
    Tile<kRows, kColumns>(problem, a, problem.b.data + j * problem.b.column_stride, c + j * problem.c_stride,
                          bias);
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
  std::memset(data_.get(), 0, static_cast<size_t>(stride_) * static_cast<size_t>(columns_) * sizeof(float));
}

void Matrix::Free::operator()(float* data) const { std::free(data); }

void Multiply(int m, int n, int k, LeftFactor a, RightFactor b, float* c, ptrdiff_t c_stride, Onto onto,
              const float* bias) {
  const Problem problem{k, a, b, c_stride, onto};
  if (n == 1) {
    const int i = Bands<kTallRows, 1>(0, m, n, problem, c, bias);
    Bands<1, 1>(i, m, n, problem, c, bias);
  } else {
    const int i = Bands<kTileRows, kTileColumns>(0, m, n, problem, c, bias);
    Bands<1, kTileColumns>(i, m, n, problem, c, bias);
  }
}

}  // namespace plumb::kernels
