#pragma once

#include <Eigen/Core>
#include <span>

namespace plumb {

/// Whitens the errors of one window, predicted minus recorded, by the uncertainty of the recorded
/// states. A Kalman filter estimates the error of the window's first state, a constant
/// (errors-in-variables); the whitened errors are its innovations divided by their standard
/// deviations. For the right simulator they are independent, with mean zero and variance one.
/// Thread-safe.
/// @param steps index of the first row of each control step, and the end; the first is the row with
/// which `errors` begins.
/// @param start_sd of each entry of the state that the window begins with, m.
/// @param sensitivity of each row to these entries, rows x m; empty where the beginning is exact.
/// @param end_sd of each row's reading, > 0.
/// @param errors rows x any number of simulators; replaced. A column with NaN stays one.
/// @return ln det of the matrix that the errors were divided by.
double WhitenWindow(std::span<const Eigen::Index> steps, const Eigen::VectorXd& start_sd,
                    const Eigen::MatrixXd& sensitivity, const Eigen::VectorXd& end_sd,
                    Eigen::Ref<Eigen::MatrixXd> errors);

/// The sensitivity of (q, v) to (q, v) `duration` earlier, in free motion: q + v duration.
/// @return 2 n x 2 n.
/// @param duration [s].
Eigen::MatrixXd FreeMotion(Eigen::Index n, double duration);

}  // namespace plumb
