#pragma once

#include <Eigen/Core>

#include "common/gaussian.h"
#include "common/random.h"

namespace plumb {

// The functions here share nothing: thread-safe.

/// Factor on a standard deviation that makes a kernel's (Silverman, "Density estimation", 1986, eq.
/// 4.14-4.15): (4 / (n_eff (n + 2)))^(1 / (n + 4)).
double Bandwidth(double effective, Eigen::Index n);

/// The non-parametric form of a distribution known by weighted samples: a Gaussian kernel on each,
/// all of the samples' covariance times the square of the bandwidth for their effective number,
/// (sum w)^2 / sum w^2. More samples than `max_components` are thinned by systematic resampling (as
/// by Kitagawa, J. Computational and Graphical Statistics 5, 1996), which draws each as often as
/// its weight says, rounded up or down; the bandwidth is then that of as many. Samples of no
/// weight, or drawn never, have no kernel.
/// @param samples n x N, finite where they have weight. @param weights N, >= 0, of positive sum.
/// @throws std::invalid_argument otherwise.
GaussianMixture KernelDensity(const Eigen::MatrixXd& samples, const Eigen::VectorXd& weights,
                              int max_components, Random& random);

}  // namespace plumb
