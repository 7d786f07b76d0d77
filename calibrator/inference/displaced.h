#pragma once

#include <Eigen/Core>

#include "common/gaussian.h"

namespace plumb {

/// A posterior whose data may have been explained by a model that is off. Each column of
/// `displacements`, n x K, is where the data's own estimate would be taken by one thing that may be
/// wrong, which is as likely to be so as a standard normal number: with the information of the data
/// alone, L = posterior^-1 - prior^-1, their estimate is as wide as L^-1 + D D' ("consider
/// parameters": Schmidt, Adv. Control Syst. 3, 1966), and is then combined with the prior by Bayes'
/// rule. So the result is never wider than the prior; and its mean, which stays where the data tell
/// much all the same, goes back to the prior's where they no longer do. Directions in which the
/// posterior is wider than the prior count as not informed. Thread-safe.
/// @param prior, posterior of the same n, with positive definite covariances.
Gaussian Displaced(const Gaussian& prior, const Gaussian& posterior,
                   const Eigen::MatrixXd& displacements);

}  // namespace plumb
