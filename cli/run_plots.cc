#include "cli/run_plots.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "plot/curves.h"
#include "plot/svg.h"

namespace plumb {
namespace {

using Points = std::vector<Eigen::Vector2d>;

struct Extent {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void Take(double value) {
    if (std::isfinite(value)) low = std::min(low, value), high = std::max(high, value);
  }
  bool empty() const { return !(low <= high); }
  double margin() const {
    return high > low ? 0.08 * (high - low) : std::max(1e-9, 0.05 * std::abs(high));
  }
};

}  // namespace

std::string ReturnsPlot(const PolicyReturns& returns) {
  Extent range;
  for (const auto* values :
       {&returns.simulated, &returns.robot, &returns.incumbent, &returns.in_the_end})
    for (const double value : *values) range.Take(value);
  if (range.empty()) return "";
  const size_t count = returns.robot.size() + 1;  // and the last one
  Svg svg(920, 300, "returns of the policies");
  const Axis x(-0.4, static_cast<double>(count) - 0.6, 72, 906),
      y(range.low - range.margin(), range.high + range.margin(), 254, 12);
  svg.Frame(x, y, "policy", "return of an episode", std::min<int>(static_cast<int>(count), 12), 6);
  const auto draw = [&](const std::vector<double>& values, const std::string& css) {
    Points line;
    for (size_t k = 0; k < values.size(); ++k)
      line.emplace_back(x.Pixel(static_cast<double>(k)), y.Pixel(values[k]));
    svg.Path(line, css + " line thick");
    if (css == "reference") return;
    for (const Eigen::Vector2d& point : line) {
      if (point.allFinite()) svg.Circle(point.x(), point.y(), 4, css + " mark");
    }
  };
  draw(returns.incumbent, "reference");
  draw(returns.simulated, "simulation");
  draw(returns.robot, "robot");
  for (const double value : returns.in_the_end)
    svg.Circle(x.Pixel(static_cast<double>(count) - 1), y.Pixel(value), 2.5, "robot mark");
  return svg.Print();
}

std::string LearnedPlot(const ParameterDescription& parameter, const std::vector<double>& mean,
                        const std::vector<double>& sd, double hidden) {
  Extent range;
  for (size_t k = 0; k < mean.size(); ++k) {
    range.Take(mean[k] - kNormal95 * sd[k]);
    range.Take(mean[k] + kNormal95 * sd[k]);
  }
  if (range.empty()) return "";
  range.Take(hidden);
  const double prior_sd = std::sqrt(parameter.variance);
  Svg svg(304, 210, "what was learnt of " + parameter.name);
  const Axis x(0, static_cast<double>(mean.size()), 66, 294),
      y(range.low - range.margin(), range.high + range.margin(), 166, 10);
  svg.Frame(x, y, "iteration", Shorten(parameter.name + " [" + parameter.unit + "]", 28),
            std::min<int>(static_cast<int>(mean.size()) + 1, 6), 5);
  svg.BeginClip(x.from(), y.to(), x.to() - x.from(), y.from() - y.to());
  Points band{{x.Pixel(0), y.Pixel(parameter.mean + kNormal95 * prior_sd)}},
      middle{{x.Pixel(0), y.Pixel(parameter.mean)}};
  for (size_t k = 0; k < mean.size(); ++k) {
    const double at = x.Pixel(static_cast<double>(k + 1));
    band.emplace_back(at, y.Pixel(mean[k] + kNormal95 * sd[k]));
    middle.emplace_back(at, y.Pixel(mean[k]));
  }
  for (size_t k = mean.size(); k-- > 0;)
    band.emplace_back(x.Pixel(static_cast<double>(k + 1)), y.Pixel(mean[k] - kNormal95 * sd[k]));
  band.emplace_back(x.Pixel(0), y.Pixel(parameter.mean - kNormal95 * prior_sd));
  svg.Path(band, "band", true);
  svg.Path(middle, "posterior line thick");
  if (std::isfinite(hidden))
    svg.Line(x.from(), y.Pixel(hidden), x.to(), y.Pixel(hidden), "reference line");
  svg.EndClip();
  return svg.Print();
}

}  // namespace plumb
