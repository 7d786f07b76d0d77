#pragma once

#include <string>
#include <vector>

namespace plumb {

// Functions here are pure: thread-safe.

/// A line with a band: y = middle(x), from low to high. All of one size.
struct Curve {
  std::string name;  ///< in the legend
  std::vector<double> x, middle, low, high;
};

struct Chart {
  std::string title, x_label, y_label;
  bool logarithmic = false;   ///< the y axis; what is not positive is then left out
  std::vector<Curve> curves;  ///< the same names in the same order as the first chart's
  bool logarithmic_x = false;
};

/// Charts, two abreast, with one legend above, as SVG. The colours of the first ten curves are told
/// apart by those who see fewer, too (eight of them are Okabe's and Ito's, "Color Universal
/// Design", 2008, or grey); the next ten have them again, dashed, and all further ones likewise.
std::string DrawCurves(const std::string& title, const std::vector<Chart>& charts);

/// Standard deviations from the mean between which 95 % of a normal distribution are.
inline constexpr double kNormal95 = 1.959963984540054;

/// Of several runs: the mean and the 95 % confidence interval of the mean by Student's t; of their
/// logarithms if asked for, as numbers that span orders of magnitude want. One run has no interval:
/// it is NaN.
struct Band {
  double middle, low, high;
};
Band ConfidenceBand(const std::vector<double>& values, bool logarithmic);

}  // namespace plumb
