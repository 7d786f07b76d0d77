#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calibrator/fit/window_errors.h"

namespace plumb {

/// Whitened residuals of the posterior's mean, to see what the model leaves unexplained. Plain
/// data: not thread-safe.
struct Residuals {
  Eigen::VectorXd whitened;  ///< without unit, one per row; NaN where there is none
  /// window, transition and coordinate of each; coordinate is an index of `coordinates`
  std::vector<WindowErrors::Row> rows;
  std::vector<std::string> coordinates;  ///< names: "q knee", "v knee"
};

}  // namespace plumb
