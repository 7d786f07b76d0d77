#include "bench/networks/eigen_network.h"

#include <Eigen/Core>
#include <vector>

namespace plumb::bench {
namespace {

using Eigen::MatrixXf;
using Eigen::VectorXf;
using Inputs = Eigen::Map<const MatrixXf>;

struct Layer {
  MatrixXf weight;
  VectorXf bias;
};

void Read(std::vector<Layer>& layers, const float* next) {
  for (Layer& layer : layers) {
    layer.weight = Inputs(next, layer.weight.rows(), layer.weight.cols());
    next += layer.weight.size();
    layer.bias = Eigen::Map<const VectorXf>(next, layer.bias.size());
    next += layer.bias.size();
  }
}

}  // namespace

struct EigenNetwork::Storage {
  std::vector<Layer> layers, direction;
  std::vector<MatrixXf> hidden;  // activations
  std::vector<MatrixXf> change;  // per layer: tangents or gradients
  const float* inputs = nullptr;
  int columns = 0;

  Inputs Below() const { return {inputs, layers.front().weight.cols(), columns}; }
};

EigenNetwork::EigenNetwork(std::span<const int> sizes, int columns)
    : storage_(std::make_unique<Storage>()) {
  for (size_t l = 1; l < sizes.size(); ++l) {
    storage_->layers.push_back({MatrixXf(sizes[l], sizes[l - 1]), VectorXf(sizes[l])});
    storage_->hidden.emplace_back(sizes[l], columns);
    storage_->change.emplace_back(sizes[l], columns);
  }
  storage_->direction = storage_->layers;
}

EigenNetwork::~EigenNetwork() = default;

void EigenNetwork::Set(std::span<const float> parameters) {
  Read(storage_->layers, parameters.data());
}

void EigenNetwork::SetDirection(std::span<const float> direction) {
  Read(storage_->direction, direction.data());
}

void EigenNetwork::Forward(const float* inputs, int columns, float* outputs) {
  Storage& s = *storage_;
  s.inputs = inputs;
  s.columns = columns;
  for (size_t l = 0; l < s.layers.size(); ++l) {
    auto z = s.hidden[l].leftCols(columns);
    if (l == 0) {
      z.noalias() = s.layers[l].weight * s.Below();
    } else {
      z.noalias() = s.layers[l].weight * s.hidden[l - 1].leftCols(columns);
    }
    z.colwise() += s.layers[l].bias;
    if (l + 1 < s.layers.size()) z = z.array().tanh();
  }
  Eigen::Map<MatrixXf>(outputs, s.hidden.back().rows(), columns) =
      s.hidden.back().leftCols(columns);
}

void EigenNetwork::Tangent(float* tangent) {
  Storage& s = *storage_;
  for (size_t l = 0; l < s.layers.size(); ++l) {
    auto dz = s.change[l].leftCols(s.columns);
    if (l == 0) {
      dz.noalias() = s.direction[l].weight * s.Below();
    } else {
      dz.noalias() = s.direction[l].weight * s.hidden[l - 1].leftCols(s.columns);
      dz.noalias() += s.layers[l].weight * s.change[l - 1].leftCols(s.columns);
    }
    dz.colwise() += s.direction[l].bias;
    if (l + 1 < s.layers.size()) dz.array() *= 1 - s.hidden[l].leftCols(s.columns).array().square();
  }
  Eigen::Map<MatrixXf>(tangent, s.change.back().rows(), s.columns) =
      s.change.back().leftCols(s.columns);
}

void EigenNetwork::Backward(const float* output_gradient, float* gradient) {
  Storage& s = *storage_;
  s.change.back().leftCols(s.columns) = Inputs(output_gradient, s.change.back().rows(), s.columns);
  float* end = gradient;
  for (const Layer& layer : s.layers) end += layer.weight.size() + layer.bias.size();
  for (size_t l = s.layers.size(); l-- > 0;) {
    const Layer& layer = s.layers[l];
    const auto d = s.change[l].leftCols(s.columns);
    end -= layer.bias.size();
    Eigen::Map<VectorXf>(end, layer.bias.size()) = d.rowwise().sum();
    end -= layer.weight.size();
    Eigen::Map<MatrixXf> dw(end, layer.weight.rows(), layer.weight.cols());
    if (l == 0) {
      dw.noalias() = d * s.Below().transpose();
    } else {
      const auto below = s.hidden[l - 1].leftCols(s.columns);
      dw.noalias() = d * below.transpose();
      auto d_below = s.change[l - 1].leftCols(s.columns);
      d_below.noalias() = layer.weight.transpose() * d;
      d_below.array() *= 1 - below.array().square();
    }
  }
}

}  // namespace plumb::bench
