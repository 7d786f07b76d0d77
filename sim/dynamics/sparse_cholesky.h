#pragma once

#include <cstddef>
#include <vector>

#include "sim/dynamics/real.h"

namespace plumb {

/// L^T D L factorisation of a symmetric positive definite matrix whose rows differ from zero only
/// at a coordinate's ancestors: nothing fills in (Featherstone, "Rigid Body Dynamics Algorithms",
/// 2008, section 6.5). In place, lower triangle, row by row. A matrix that is not positive definite
/// gives a solution that is not one. Real is double, or a pack with one matrix per lane. Only the
/// constructor allocates; nothing throws. Not thread-safe.
template <class Real>
class SparseCholesky {
 public:
  /// @param n rows of the matrices.
  explicit SparseCholesky(size_t n) : inverse_(n) {}

  /// Replaces the matrix, n x n, by its factors. @param ancestors n: the parent of each coordinate,
  /// before it in order; -1 = none.
  void Factorize(const std::vector<int>& ancestors, Real* matrix) {
    const size_t n = ancestors.size();
    for (size_t k = n; k-- > 0;) {
      Real* row = matrix + k * n;
      const Real inverse = 1 / row[k];
      inverse_[k] = inverse;
      for (int i = ancestors[k]; i >= 0; i = ancestors[static_cast<size_t>(i)]) {
        Real* above = matrix + static_cast<size_t>(i) * n;
        const Real factor = row[i] * inverse;
        for (int j = i; j >= 0; j = ancestors[static_cast<size_t>(j)]) above[j] -= factor * row[j];
        row[i] = factor;
      }
    }
  }

  /// Overwrites b, of n entries, by the solution. @param factors of the last Factorize.
  void Solve(const std::vector<int>& ancestors, const Real* factors, Real* b) const {
    const size_t n = ancestors.size();
    for (size_t i = n; i-- > 0;) {
      for (int j = ancestors[i]; j >= 0; j = ancestors[static_cast<size_t>(j)])
        b[j] -= factors[i * n + static_cast<size_t>(j)] * b[i];
    }
    for (size_t i = 0; i < n; ++i) {
      b[i] *= inverse_[i];
      for (int j = ancestors[i]; j >= 0; j = ancestors[static_cast<size_t>(j)])
        b[i] -= factors[i * n + static_cast<size_t>(j)] * b[j];
    }
  }

 private:
  std::vector<Real> inverse_;
};

}  // namespace plumb
