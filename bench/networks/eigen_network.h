#pragma once

#include <memory>
#include <span>

namespace plumb::bench {

/// The same work as kernels::Network and kernels::Tape by Eigen's products, in as many lines as
/// that takes. Built once per level of instruction set like the kernels, hence no Eigen types here.
/// One thread at a time; nothing allocates but the constructor.
class __attribute__((visibility("default"))) EigenNetwork {
 public:
  /// @param sizes inputs, hidden..., outputs. @param columns the most samples it will ever hold.
  EigenNetwork(std::span<const int> sizes, int columns);
  ~EigenNetwork();

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
