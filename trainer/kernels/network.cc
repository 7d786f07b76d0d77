#include "trainer/kernels/network.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "trainer/kernels/matrix.h"
#include "trainer/kernels/tanh.h"

namespace plumb::kernels {
namespace {

// Activations of a block and their derivatives stay in the second-level cache between layers.
// Blocks are whole numbers of the products' tiles, at every level of instruction set.
constexpr int kBlock = 192;
constexpr int kTile = 12;

LeftFactor AsLeft(const Matrix& matrix, int column = 0) {
  return {matrix.column(column), matrix.stride()};
}
RightFactor AsRight(const Matrix& matrix, int column = 0) {
  return {matrix.column(column), 1, matrix.stride()};
}
RightFactor Transposed(const RightFactor& factor) {
  return {factor.data, factor.column_stride, factor.row_stride};
}

/// Calls f(first, count) for each block of the columns, in order.
template <class F>
void ForBlocks(int columns, F&& f) {
  const int blocks = (columns + kBlock - 1) / kBlock;
  const int share = blocks > 0 ? (columns + blocks - 1) / blocks : 0;
  const int width = (share + kTile - 1) / kTile * kTile;
  for (int first = 0; first < columns; first += width) f(first, std::min(width, columns - first));
}

void ApplyTanh(float* data, ptrdiff_t stride, int padded_rows, int columns) {
  for (int j = 0; j < columns; ++j, data += stride) {
    for (int i = 0; i < padded_rows; i += kWidth) Store(data + i, Tanh(Load(data + i)));
  }
}

/// d *= 1 - h^2, the derivative of h = tanh(z).
void MultiplyByTanhDerivative(Matrix& d, const Matrix& h, int h_column, int columns) {
  for (int j = 0; j < columns; ++j) {
    float* to = d.column(j);
    const float* activation = h.column(h_column + j);
    for (int i = 0; i < d.padded_rows(); i += kWidth) {
      const Packet a = Load(activation + i);
      Store(to + i, Load(to + i) * (1.0f - a * a));
    }
  }
}

/// sum += the sum of the columns, taken in order; several packets at a time, whose sums do not wait
/// for each other.
template <int kPackets>
int AddColumns(int i, const Matrix& d, int columns, float* sum) {
  for (; i + kPackets * kWidth <= d.padded_rows(); i += kPackets * kWidth) {
    Packet total[kPackets];
    for (int k = 0; k < kPackets; ++k) total[k] = Load(sum + i + k * kWidth);
    for (int j = 0; j < columns; ++j) {
      const float* column = d.column(j) + i;
#pragma GCC unroll 8
      for (int k = 0; k < kPackets; ++k) total[k] += Load(column + k * kWidth);
    }
    for (int k = 0; k < kPackets; ++k) Store(sum + i + k * kWidth, total[k]);
  }
  return i;
}

void AddColumns(const Matrix& d, int columns, float* sum) {
  AddColumns<1>(AddColumns<8>(0, d, columns, sum), d, columns, sum);
}

/// Copies between a dense rows x columns array and the padded columns of a matrix.
void Pack(const float* dense, int columns, Matrix& matrix) {
  const size_t bytes = static_cast<size_t>(matrix.rows()) * sizeof(float);
  for (int j = 0; j < columns; ++j, dense += matrix.rows())
    std::memcpy(matrix.column(j), dense, bytes);
}

void Unpack(const Matrix& matrix, int columns, float* dense) {
  const size_t bytes = static_cast<size_t>(matrix.rows()) * sizeof(float);
  for (int j = 0; j < columns; ++j, dense += matrix.rows())
    std::memcpy(dense, matrix.column(j), bytes);
}

}  // namespace

struct Network::Layers {
  struct Layer {
    Layer(int in, int out, bool few_rows)
        : weight(out, in), transposed(in, out), bias(out, 1), few(few_rows) {}
    Matrix weight;      // out x in
    Matrix transposed;  // in x out
    Matrix bias;        // out x 1
    bool few;           // rows; what is below is then a Matrix

    /// to = onto + weight below.
    void Apply(const RightFactor& below, int columns, float* to, ptrdiff_t stride, Onto onto,
               const Matrix& what) const {
      if (few) {
        MultiplyFewRows(weight.rows(), columns, transposed, below.data, below.column_stride, to,
                        stride, onto, what.column(0));
      } else {
        Multiply(weight.padded_rows(), columns, weight.columns(), AsLeft(weight), below, to, stride,
                 onto, what.column(0));
      }
    }
  };
  std::vector<Layer> all;
};

Network::Network(std::span<const int> sizes) : layers_(std::make_unique<Layers>()) {
  for (size_t i = 1; i < sizes.size(); ++i)
    layers_->all.emplace_back(sizes[i - 1], sizes[i], i > 1 && FewRows(sizes[i]));
}

Network::Network(Network&&) noexcept = default;
Network::~Network() = default;

int Network::inputs() const { return layers_->all.front().weight.columns(); }
int Network::outputs() const { return layers_->all.back().weight.rows(); }

int Network::parameter_count() const {
  int count = 0;
  for (const Layers::Layer& layer : layers_->all)
    count += layer.weight.rows() * (layer.weight.columns() + 1);
  return count;
}

void Network::Set(std::span<const float> parameters) {
  const float* next = parameters.data();
  for (Layers::Layer& layer : layers_->all) {
    Pack(next, layer.weight.columns(), layer.weight);
    next += ptrdiff_t{layer.weight.rows()} * layer.weight.columns();
    Pack(next, 1, layer.bias);
    next += layer.weight.rows();
    Transpose(layer.weight, layer.transposed);
  }
}

struct Tape::Storage {
  std::vector<Matrix> hidden;  // activations of all columns, per hidden layer
  std::vector<Matrix> block;   // per layer: outputs, tangents or gradients of one block
  std::vector<Matrix> weight_gradient, bias_gradient;
  int capacity = 0;
  int columns = 0;                // of the last Forward
  const float* inputs = nullptr;  // of the last Forward
};

Tape::Tape(std::span<const int> sizes, int columns) : storage_(std::make_unique<Storage>()) {
  Storage& s = *storage_;
  s.capacity = columns;
  for (size_t i = 1; i < sizes.size(); ++i) {
    if (i + 1 < sizes.size()) s.hidden.emplace_back(sizes[i], columns);
    s.block.emplace_back(sizes[i], std::min(columns, kBlock));
    // Of few rows, its transpose.
    const bool few = i > 1 && FewRows(sizes[i]);
    s.weight_gradient.emplace_back(sizes[few ? i - 1 : i], sizes[few ? i : i - 1]);
    s.bias_gradient.emplace_back(sizes[i], 1);
  }
}

Tape::Tape(Tape&&) noexcept = default;
Tape& Tape::operator=(Tape&&) noexcept = default;
Tape::~Tape() = default;

int Tape::capacity() const { return storage_->capacity; }

void Tape::Forward(const Network& network, const float* inputs, int columns, float* outputs) {
  Storage& s = *storage_;
  s.inputs = inputs;
  s.columns = columns;
  const int inputs_per_column = network.inputs();
  ForBlocks(columns, [&](int first, int count) {
    RightFactor below{inputs + ptrdiff_t{first} * inputs_per_column, 1, inputs_per_column};
    for (size_t l = 0; l < s.block.size(); ++l) {
      const auto& layer = network.layers_->all[l];
      const bool last = l + 1 == s.block.size();
      Matrix& above = last ? s.block[l] : s.hidden[l];
      float* to = above.column(last ? 0 : first);
      layer.Apply(below, count, to, above.stride(), Onto::kBias, layer.bias);
      if (!last) ApplyTanh(to, above.stride(), above.padded_rows(), count);
      below = {to, 1, above.stride()};
    }
    Unpack(s.block.back(), count, outputs + ptrdiff_t{first} * network.outputs());
  });
}

void Tape::Tangent(const Network& network, const Network& direction, float* tangent) {
  Storage& s = *storage_;
  const int inputs_per_column = network.inputs();
  ForBlocks(s.columns, [&](int first, int count) {
    RightFactor below{s.inputs + ptrdiff_t{first} * inputs_per_column, 1, inputs_per_column};
    for (size_t l = 0; l < s.block.size(); ++l) {
      // z' = V h + c + W h', h' = (1 - h^2) z'
      const auto& layer = network.layers_->all[l];
      const auto& change = direction.layers_->all[l];
      Matrix& dz = s.block[l];
      change.Apply(below, count, dz.column(0), dz.stride(), Onto::kBias, change.bias);
      if (l > 0)
        layer.Apply(AsRight(s.block[l - 1]), count, dz.column(0), dz.stride(), Onto::kItself,
                    change.bias);
      if (l + 1 < s.block.size()) {
        MultiplyByTanhDerivative(dz, s.hidden[l], first, count);
        below = AsRight(s.hidden[l], first);
      }
    }
    Unpack(s.block.back(), count, tangent + ptrdiff_t{first} * network.outputs());
  });
}

void Tape::Backward(const Network& network, const float* output_gradient, float* gradient) {
  Storage& s = *storage_;
  if (s.columns == 0) {  // else the first block sets them
    for (Matrix& matrix : s.weight_gradient) matrix.SetZero();
  }
  for (Matrix& matrix : s.bias_gradient) matrix.SetZero();
  const int inputs_per_column = network.inputs();
  ForBlocks(s.columns, [&](int first, int count) {
    Pack(output_gradient + ptrdiff_t{first} * network.outputs(), count, s.block.back());
    for (size_t l = s.block.size(); l-- > 0;) {
      // dW += d h_below', db += d 1, d_below = (W' d) (1 - h_below^2)
      Matrix& d = s.block[l];
      const RightFactor below = l > 0 ? AsRight(s.hidden[l - 1], first)
                                      : RightFactor{s.inputs + ptrdiff_t{first} * inputs_per_column,
                                                    1, inputs_per_column};
      Matrix& dw = s.weight_gradient[l];
      const Onto onto = first == 0 ? Onto::kZero : Onto::kItself;
      if (network.layers_->all[l].few) {
        Multiply(dw.padded_rows(), dw.columns(), count, AsLeft(s.hidden[l - 1], first),
                 Transposed(AsRight(d)), dw.column(0), dw.stride(), onto);
      } else {
        Multiply(dw.padded_rows(), dw.columns(), count, AsLeft(d), Transposed(below), dw.column(0),
                 dw.stride(), onto);
      }
      AddColumns(d, count, s.bias_gradient[l].column(0));
      if (l > 0) {
        const Matrix& transposed = network.layers_->all[l].transposed;
        Matrix& d_below = s.block[l - 1];
        Multiply(d_below.padded_rows(), count, transposed.columns(), AsLeft(transposed), AsRight(d),
                 d_below.column(0), d_below.stride(), Onto::kZero);
        MultiplyByTanhDerivative(d_below, s.hidden[l - 1], first, count);
      }
    }
  });
  for (size_t l = 0; l < s.block.size(); ++l) {
    const Matrix& dw = s.weight_gradient[l];
    if (network.layers_->all[l].few) {
      for (int j = 0; j < dw.columns(); ++j) {
        for (int i = 0; i < dw.rows(); ++i)
          gradient[ptrdiff_t{i} * dw.columns() + j] = dw.column(j)[i];
      }
    } else {
      Unpack(dw, dw.columns(), gradient);
    }
    gradient += ptrdiff_t{dw.rows()} * dw.columns();
    Unpack(s.bias_gradient[l], 1, gradient);
    gradient += s.bias_gradient[l].rows();
  }
}

void AdamStep(int count, int step, float rate, float l2, const float* const (&gradients)[2],
              float* __restrict parameters, float* __restrict first_moment,
              float* __restrict second_moment) {
  const float* __restrict one = gradients[0];
  const float* __restrict other = gradients[1];
  constexpr float kBeta1 = 0.9f, kBeta2 = 0.999f, kEpsilon = 1e-8f;
  // The moments' bias corrections, folded into rate and denominator.
  const float correction = static_cast<float>(1 / std::sqrt(1 - std::pow(double{kBeta2}, step)));
  const float scale = static_cast<float>(rate / (1 - std::pow(double{kBeta1}, step)));
  for (int i = 0; i < count; ++i) {
    const float g = one[i] + other[i] + l2 * parameters[i];
    first_moment[i] = kBeta1 * first_moment[i] + (1 - kBeta1) * g;
    second_moment[i] = kBeta2 * second_moment[i] + (1 - kBeta2) * g * g;
    parameters[i] -=
        scale * first_moment[i] / (std::sqrt(second_moment[i]) * correction + kEpsilon);
  }
}

const char* InstructionSet() { return PLUMB_INSTRUCTION_SET; }

}  // namespace plumb::kernels
