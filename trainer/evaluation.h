#pragma once

#include <span>
#include <string>

#include "common/special_numbers.h"

namespace plumb {

/// A policy without exploration, in simulators that training has not seen.
struct Evaluation {
  int episodes = 0;
  int failed = 0;  ///< of these: not finite, or no simulator; left out below
  // Returns; NaN if there are none.
  double mean = kNaN;
  double tenth = kNaN;  ///< 10th percentile
  double worst = kNaN;
};

/// Of returns, NaN where an episode failed. The percentile is interpolated linearly between the
/// ordered returns. Thread-safe.
Evaluation Evaluate(std::span<const double> returns);

/// Mean of the lowest `share` of the returns, rounded up to whole episodes; NaN are left out, and
/// NaN if there are no others. Thread-safe.
double MeanOfWorst(std::span<const double> returns, double share);

/// Standard deviation of returns; NaN are left out, and 0 if fewer than two are left. Thread-safe.
double Scatter(std::span<const double> returns);

/// "-142.1 mean, -263.3 10th percentile, -370.2 worst", and how many failed.
std::string Summary(const Evaluation& evaluation);

}  // namespace plumb
