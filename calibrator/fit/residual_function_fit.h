#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "calibrator/fit/residual_regression.h"
#include "common/random.h"
#include "robot/residual.h"

namespace plumb {

/// Inputs and outputs of a residual function, a column for each example.
struct Examples {
  Eigen::MatrixXd inputs, outputs;
};

struct FunctionFitOptions {
  int centres;     ///< at most
  double width;    ///< ResidualRegression::Weights
  double unknown;  ///< factor of the sd that the evidence says of a change before anything is known
};

/// A residual function that was learnt from the examples of several draws of the parameters: the
/// kernel's length is that of the greatest evidence for the first one's, whose scales and centres
/// all of them have. Const use is thread-safe.
class FunctionFit {
 public:
  /// @param draws at least one, each of kFewestForResidual examples or more.
  FunctionFit(std::vector<Examples> draws, const FunctionFitOptions& options, Random random);

  /// Without noise. To double precision: Round what is done.
  const ResidualFunction& function() const { return function_; }
  double length() const { return length_; }  ///< in units of the inputs' sd
  /// Errors of the draw's examples, each predicted by the others.
  Eigen::MatrixXd LeftOut(size_t draw) const;
  /// What the others predict of each: outputs less those errors.
  Eigen::MatrixXd Explained(size_t draw) const { return draws_[draw].outputs - LeftOut(draw); }

 private:
  ResidualRegression Choose(const Examples& examples);

  std::vector<Examples> draws_;
  ResidualFeatures features_;
  std::vector<ResidualRegression> regressions_;
  ResidualFunction function_;
  double length_ = 0;
};

inline constexpr int kFewestForResidual = 20;

/// To single precision: they are not known better, and as messages have them. Thread-safe.
void Round(ResidualFunction* function);

}  // namespace plumb
