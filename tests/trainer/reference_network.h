#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/random.h"

namespace plumb {

/// A tanh multilayer perceptron in double, written for clarity: the truth the kernels are held
/// against.
struct ReferenceNetwork {
  std::vector<int> sizes;

  Eigen::Index parameter_count() const {
    Eigen::Index count = 0;
    for (size_t l = 1; l < sizes.size(); ++l) count += Eigen::Index{sizes[l - 1] + 1} * sizes[l];
    return count;
  }

  /// Activations of every layer, inputs first, outputs last.
  std::vector<Eigen::MatrixXd> Forward(const Eigen::VectorXd& parameters,
                                       const Eigen::MatrixXd& inputs) const {
    std::vector<Eigen::MatrixXd> layers{inputs};
    const double* next = parameters.data();
    for (size_t l = 1; l < sizes.size(); ++l) {
      const Eigen::Map<const Eigen::MatrixXd> w(next, sizes[l], sizes[l - 1]);
      next += w.size();
      const Eigen::Map<const Eigen::VectorXd> b(next, sizes[l]);
      next += b.size();
      Eigen::MatrixXd z = w * layers.back();
      z.colwise() += b;
      if (l + 1 < sizes.size()) z = z.unaryExpr([](double x) { return std::tanh(x); });
      layers.push_back(z);
    }
    return layers;
  }

  Eigen::MatrixXd Outputs(const Eigen::VectorXd& parameters, const Eigen::MatrixXd& inputs) const {
    return Forward(parameters, inputs).back();
  }

  /// Gradient of sum(output_gradient * outputs).
  Eigen::VectorXd Backward(const Eigen::VectorXd& parameters, const Eigen::MatrixXd& inputs,
                           const Eigen::MatrixXd& output_gradient) const {
    const std::vector<Eigen::MatrixXd> layers = Forward(parameters, inputs);
    Eigen::VectorXd gradient(parameter_count());
    Eigen::Index end = gradient.size();
    Eigen::MatrixXd d = output_gradient;
    for (size_t l = sizes.size() - 1; l > 0; --l) {
      const Eigen::Index weights = Eigen::Index{sizes[l]} * sizes[l - 1];
      const Eigen::Index begin = end - sizes[l] - weights;
      Eigen::Map<Eigen::MatrixXd>(gradient.data() + begin, sizes[l], sizes[l - 1]) =
          d * layers[l - 1].transpose();
      gradient.segment(begin + weights, sizes[l]) = d.rowwise().sum();
      const Eigen::Map<const Eigen::MatrixXd> w(parameters.data() + begin, sizes[l], sizes[l - 1]);
      if (l > 1) {
        d = ((w.transpose() * d).array() * (1 - layers[l - 1].array().square())).matrix().eval();
      }
      end = begin;
    }
    return gradient;
  }
};

inline Eigen::MatrixXf RandomMatrix(Eigen::Index rows, Eigen::Index columns, double scale,
                                    Random& random) {
  Eigen::MatrixXf matrix(rows, columns);
  for (float& value : matrix.reshaped()) value = static_cast<float>(scale * random.Normal());
  return matrix;
}

inline double RelativeError(const Eigen::MatrixXd& value, const Eigen::MatrixXd& truth) {
  return (value - truth).norm() / truth.norm();
}

}  // namespace plumb
