#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/random.h"

namespace plumb {

/// Weights of a fresh multilayer perceptron, flat as in GaussianPolicy (without log_std): each W
/// orthogonal (its rows or its columns, whichever are fewer, are orthogonal and of length sqrt(2),
/// in the last layer `output_gain`), each b zero (Saxe, McClelland and Ganguli, 2014). Thread-safe.
/// @param sizes inputs, hidden..., outputs; at least two, all >= 1.
Eigen::VectorXf OrthogonalParameters(const std::vector<int>& sizes, double output_gain,
                                     Random& random);

}  // namespace plumb
