#pragma once

/// The inner loops of a residual, in a shared library of their own that is built once per level of
/// instruction set (plumb_levels), hence without Eigen's types. The same bits at each level: sums
/// are taken in order, and nothing is fused. Single precision. Thread-safe; nothing allocates.
#define PLUMB_RESIDUAL_KERNELS_EXPORT __attribute__((visibility("default")))

namespace plumb::residual_kernels {

/// Numbers come in packs: a cache line, and what the widest registers hold.
struct Pack {
  static constexpr int kSize = 16;
  alignas(64) float x[kSize];
};
constexpr int Packs(int count) { return (count + Pack::kSize - 1) / Pack::kSize; }

/// y = A x. @param a column after column, each of `packs` packs. @param x `columns` numbers.
/// @param y `packs` packs.
PLUMB_RESIDUAL_KERNELS_EXPORT void Multiply(const Pack* a, int packs, int columns, const float* x,
                                            float* y);
/// The same of a square matrix, packs * Pack::kSize columns, that is zero above its diagonal.
PLUMB_RESIDUAL_KERNELS_EXPORT void MultiplyLower(const Pack* a, int packs, const float* x,
                                                 float* y);
/// Replaces each x by e^min(x, 0), to 3e-7 of its value; below -40 by e^-40. x = k ln 2 + r,
/// Taylor's series of e^r to the 7th power, 2^k by its bits. @param x `packs` packs.
PLUMB_RESIDUAL_KERNELS_EXPORT void ExpOfNegatives(float* x, int packs);

}  // namespace plumb::residual_kernels
