#pragma once

#include <memory>
#include <span>

/// The inner loops of training, in a shared library of their own that is built once per level of
/// instruction set; the dynamic linker takes the best one the machine can run (glibc-hwcaps). Hence
/// the plain interface: no Eigen types, whose layout would depend on the instruction set, cross it.
#define PLUMB_KERNELS_EXPORT __attribute__((visibility("default")))

namespace plumb::kernels {

class Tape;

/// The weights of a multilayer perceptron (tanh hidden layers, linear output), rearranged for
/// speed. Parameters are flat: per layer W (out x in, column-major) then b (out). Const use is
/// thread-safe.
class PLUMB_KERNELS_EXPORT Network {
 public:
  /// @param sizes inputs, hidden..., outputs; at least two, all >= 1.
  explicit Network(std::span<const int> sizes);
  Network(Network&&) noexcept;
  ~Network();

  int inputs() const;
  int outputs() const;
  int parameter_count() const;
  /// @param parameters parameter_count() values; more may follow and are ignored.
  void Set(std::span<const float> parameters);

 private:
  friend class Tape;
  struct Layers;
  std::unique_ptr<Layers> layers_;
};

/// The activations of a network for a set of samples, remembered so that derivatives can be taken
/// there. Everything is single precision. The samples are worked on in blocks that fit the
/// second-level cache. One thread at a time; nothing allocates but the constructor. The bits of a
/// result depend on the samples, their order and the instruction set, on nothing else.
class PLUMB_KERNELS_EXPORT Tape {
 public:
  /// @param columns the most samples it will ever hold, >= 1.
  Tape(std::span<const int> sizes, int columns);
  Tape(Tape&&) noexcept;
  Tape& operator=(Tape&&) noexcept;
  ~Tape();

  int capacity() const;

  /// Evaluates the network. Matrices are column-major, one sample a column.
  /// @param inputs inputs x columns; must outlive later calls of Tangent and Backward, which read
  /// it again.
  /// @param outputs outputs x columns, written.
  void Forward(const Network& network, const float* inputs, int columns, float* outputs);

  /// The derivative of the outputs of the last Forward along a direction in parameter space
  /// (forward mode): J v.
  /// @param network as in Forward. @param direction v, as the parameters of another network of the
  /// same sizes.
  /// @param tangent outputs x columns, written.
  void Tangent(const Network& network, const Network& direction, float* tangent);

  /// The gradient of sum(output_gradient * outputs) in the parameters (reverse mode): J' g.
  /// @param network as in Forward. @param output_gradient outputs x columns.
  /// @param gradient parameter_count() values, written.
  void Backward(const Network& network, const float* output_gradient, float* gradient);

 private:
  struct Storage;
  std::unique_ptr<Storage> storage_;
};

/// One step of Adam (Kingma and Ba, 2015) with beta1 = 0.9, beta2 = 0.999, epsilon = 1e-8.
/// @param step counts from 1. @param l2 added to the gradient: l2 * parameter. @param gradients
/// their sum is the gradient. All arrays have `count` values; parameters and moments are updated in
/// place.
PLUMB_KERNELS_EXPORT void AdamStep(int count, int step, float rate, float l2,
                                   const float* const (&gradients)[2], float* parameters,
                                   float* first_moment, float* second_moment);

/// "x86-64", "x86-64-v3", ...: the level of instruction set this copy was compiled for.
PLUMB_KERNELS_EXPORT const char* InstructionSet();

}  // namespace plumb::kernels
