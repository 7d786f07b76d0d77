#include "robot/residual_kernels.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "common/packet.h"

namespace plumb::residual_kernels {
namespace {

using kernels::IntPacket;
using kernels::kWidth;
using kernels::Load;
using kernels::Packet;
using kernels::Store;

// Adds to kPackets packets of y what columns first to last of A give; the sums stay in registers.
template <int kPackets>
void AddRows(const float* a, int rows, int first, int last, const float* x, float* y) {
  Packet sums[kPackets];
#pragma GCC unroll 8
  for (int i = 0; i < kPackets; ++i) sums[i] = Load(y + i * kWidth);
  a += ptrdiff_t{first} * rows;
  for (int j = first; j < last; ++j, a += rows) {
#pragma GCC unroll 8
    for (int i = 0; i < kPackets; ++i) sums[i] += Load(a + i * kWidth) * x[j];
  }
#pragma GCC unroll 8
  for (int i = 0; i < kPackets; ++i) Store(y + i * kWidth, sums[i]);
}

// packets: enough sums at a time that none waits for the one before, and all in registers
constexpr int kMany = kWidth == 4 ? 8 : 4;

// One pack has too few sums for that: each fourth column has its own.
void MultiplyOne(const float* a, int columns, const float* x, float* y) {
  constexpr ptrdiff_t kSums = 4;
  for (int i = 0; i < Pack::kSize; i += kWidth) {
    Packet sums[kSums] = {};
    const float* column = a + i;
    int j = 0;
    for (; j + kSums <= columns; j += kSums, column += kSums * Pack::kSize) {
#pragma GCC unroll 4
      for (ptrdiff_t k = 0; k < kSums; ++k) sums[k] += Load(column + k * Pack::kSize) * x[j + k];
    }
    for (; j < columns; ++j, column += Pack::kSize) sums[0] += Load(column) * x[j];
    Store(y + i, (sums[0] + sums[1]) + (sums[2] + sums[3]));
  }
}

}  // namespace

void Multiply(const Pack* packed, int packs, int columns, const float* x, float* y) {
  const float* a = packed->x;
  if (packs == 1) return MultiplyOne(a, columns, x, y);
  const int rows = packs * Pack::kSize;
  std::fill_n(y, rows, 0.0f);
  int i = 0;
  for (; i + kMany * kWidth <= rows; i += kMany * kWidth)
    AddRows<kMany>(a + i, rows, 0, columns, x, y + i);
  for (; i < rows; i += kWidth) AddRows<1>(a + i, rows, 0, columns, x, y + i);
}

void MultiplyLower(const Pack* packed, int packs, const float* x, float* y) {
  const float* a = packed->x;
  const int rows = packs * Pack::kSize;
  std::fill_n(y, rows, 0.0f);
  // the columns that all rows of a block have, and each packet's others
  int done = 0;
  for (; done + kMany * kWidth <= rows; done += kMany * kWidth)
    AddRows<kMany>(a + done, rows, 0, done, x, y + done);
  for (int i = 0; i < rows; i += kWidth) {
    const int common = i < done ? i / (kMany * kWidth) * (kMany * kWidth) : 0;
    AddRows<1>(a + i, rows, common, i + kWidth, x, y + i);
  }
}

void ExpOfNegatives(float* x, int packs) {
  constexpr float kLog2E = 1.44269504f;
  // ln 2 = first + second; the first has 15 bits, so that k times it is exact
  constexpr float kFirst = 0.693145752f, kSecond = 1.42860677e-6f;
  // next to nothing beside 1, and squares of it are still normal numbers, which are faster
  constexpr float kLeast = 40;
  constexpr float kRound = 12582912.0f;  // 1.5 * 2^23: adding it rounds to an integer
  constexpr float kSeries[] = {1.f / 5040, 1.f / 720, 1.f / 120, 1.f / 24, 1.f / 6, 0.5f, 1, 1};
  const Packet zero{}, least = zero - kLeast;
  for (int i = 0; i < packs * Pack::kSize; i += kWidth) {
    Packet above = Load(x + i);
    above = above < zero ? above : zero;
    above = above > least ? above : least;
    const Packet shifted = above * kLog2E + kRound, k = shifted - kRound;
    const Packet r = (above - k * kFirst) - k * kSecond;
    Packet sum{};
#pragma GCC unroll 8
    for (const float term : kSeries) sum = sum * r + term;
    IntPacket bits;  // whose lowest are k's
    std::memcpy(&bits, &shifted, sizeof bits);
    bits = (bits + 127) << 23;
    Packet power;
    std::memcpy(&power, &bits, sizeof power);
    Store(x + i, sum * power);
  }
}

}  // namespace plumb::residual_kernels
