#pragma once

#include <memory>
#include <span>

namespace plumb::bench {

/// The same work as kernels::Network and kernels::Tape by oneDNN's inner products, weights in the
/// layout that it prefers. It chooses the instruction set itself. One thread at a time.
class OnednnNetwork {
 public:
  /// @param sizes inputs, hidden..., outputs. @param columns samples, always as many.
  OnednnNetwork(std::span<const int> sizes, int columns);
  ~OnednnNetwork();

  /// @param parameters per layer W (out x in, column-major), then b (out).
  void Set(std::span<const float> parameters);
  void SetDirection(std::span<const float> direction);
  /// All as in kernels::Tape: column-major, a sample a column.
  void Forward(const float* inputs, int columns, float* outputs);
  void Tangent(float* tangent);
  void Backward(const float* output_gradient, float* gradient);

 private:
  struct Storage;
  std::unique_ptr<Storage> storage_;
};

}  // namespace plumb::bench
