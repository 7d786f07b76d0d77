#pragma once

#include <cstddef>
#include <memory>

#include "common/packet.h"

/// Matrices laid out for the kernels, and their product. For this folder only. Not thread-safe.

namespace plumb::kernels {

/// A column-major matrix. Columns begin on cache lines; their rows are padded to whole packets, and
/// the padding is zero for ever (products, tanh and the rest keep it so). The distance between
/// columns is an odd number of cache lines: a walk along a row then uses every set of the
/// first-level cache instead of a few.
class Matrix {
 public:
  Matrix() = default;
  Matrix(int rows, int columns);

  int rows() const { return rows_; }
  int padded_rows() const { return (rows_ + kWidth - 1) / kWidth * kWidth; }
  int columns() const { return columns_; }
  ptrdiff_t stride() const { return stride_; }
  float* column(int j) { return data_.get() + j * stride_; }
  const float* column(int j) const { return data_.get() + j * stride_; }

  void SetZero();

 private:
  struct Free {
    void operator()(float* data) const;
  };

  int rows_ = 0;
  int columns_ = 0;
  ptrdiff_t stride_ = 0;
  std::unique_ptr<float[], Free> data_;
};

/// The right factor of a product: element (k, j) is at data[k * row_stride + j * column_stride].
/// Any strides will do, so a transpose costs nothing.
struct RightFactor {
  const float* data;
  ptrdiff_t row_stride, column_stride;
};

/// The left factor: columns as in Matrix.
struct LeftFactor {
  const float* data;
  ptrdiff_t stride;
};

/// The summand of a product: nothing, the bias, or C as it is.
enum class Onto { kZero, kBias, kItself };

/// C = onto + A B with A (m x k), B (k x n), C (m x n). The sums over k are taken in order, one
/// after the other, so that an element's bits depend on its row of A and column of B alone, not on
/// n or its place.
/// @param m rows, a multiple of kWidth (padded). @param bias m values for Onto::kBias, else
/// ignored.
void Multiply(int m, int n, int k, LeftFactor a, RightFactor b, float* c, ptrdiff_t c_stride,
              Onto onto, const float* bias = nullptr);

/// Whether a matrix has so few rows that padding them to whole packets would be most of the work.
/// The same at each level of instruction set, as its sums are others then.
constexpr bool FewRows(int rows) { return rows <= 2; }

/// The same product for a C of few rows, by scalar products of columns: C(i, j) = onto(i, j) +
/// A'(:, i) . B(:, j).
/// @param rows of C. @param transposed A' (k x rows). @param b the columns of B.
void MultiplyFewRows(int rows, int n, const Matrix& transposed, const float* b, ptrdiff_t b_stride,
                     float* c, ptrdiff_t c_stride, Onto onto, const float* bias = nullptr);

/// to = from', both of whole size.
void Transpose(const Matrix& from, Matrix& to);

}  // namespace plumb::kernels
