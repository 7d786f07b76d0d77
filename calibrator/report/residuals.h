#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calibrator/fit/window_errors.h"

namespace plumb {

/// Whitened residuals of the posterior's mean, for a look at what the model leaves unexplained.
struct Residuals {
  Eigen::VectorXd whitened;  ///< NaN where there is none
  /// what each is of; coordinate is an index of `coordinates`
  std::vector<WindowErrors::Row> rows;
  std::vector<std::string> coordinates;  ///< names: "q knee", "v knee"
};

}  // namespace plumb
