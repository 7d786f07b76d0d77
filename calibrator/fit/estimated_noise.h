#pragma once

#include <Eigen/Core>
#include <span>

#include "calibrator/fit/window_errors.h"
#include "calibrator/inference/laplace.h"

namespace plumb {

// What the errors that a fit leaves say of the noise, entry by entry of (q, v). Thread-safe, but
// for errors that two threads would share.

/// Of the units of the state (Task::state_scale): an error that nobody needs to explain.
inline constexpr double kNegligible = 1e-5;

/// The noise by the errors' scale: that times the recorded noise, or the assumed one. Physical
/// units.
Eigen::VectorXd EstimatedNoise(const WindowErrors& errors, const LaplaceFit& fit);
/// The same of any noise that the errors were whitened by.
Eigen::VectorXd ScaledNoise(Eigen::VectorXd noise, const LaplaceFit& fit);

/// Root mean square error of each entry, in units of the noise as it is assumed; 0 where there is
/// none.
Eigen::VectorXd RootMeanSquares(const WindowErrors& errors, const LaplaceFit& fit);

/// Whether what a fit has left is rounding: noise of kNegligible at most, and hardly an error
/// beyond five times that, as the noise's robust estimate may be that of the smaller errors alone.
/// @param noise_sd of each entry of (q, v). @param units Task::state_scale. @param rows of the
/// errors. @param errors whitened.
bool LeavesRounding(const Eigen::VectorXd& noise_sd, const Eigen::VectorXd& units,
                    std::span<const WindowErrors::Row> rows, const Eigen::VectorXd& errors);

}  // namespace plumb
