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
  Extent range, policies;
  for (const auto* values : {&returns.simulated, &returns.robot, &returns.incumbent})
    for (const auto& [policy, value] : *values) policies.Take(policy), range.Take(value);
  for (const double value : returns.in_the_end) range.Take(value);
  if (range.empty()) return "";
  policies.Take(returns.last);
  Svg svg(920, 300, "returns of the policies");
  const Axis x(policies.low - 0.4, policies.high + 0.4, 72, 906),
      y(range.low - range.margin(), range.high + range.margin(), 254, 12);
  svg.Frame(x, y, "policy", "return of an episode",
            std::min(static_cast<int>(policies.high - policies.low) + 1, 12), 6);
  const auto draw = [&](const std::map<int, double>& values, const std::string& css) {
    Points line;
    for (const auto& [policy, value] : values) line.emplace_back(x.Pixel(policy), y.Pixel(value));
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
    svg.Circle(x.Pixel(returns.last), y.Pixel(value), 2.5, "robot mark");
  return svg.Print();
}

std::string LearnedPlot(const ParameterDescription& parameter, const std::vector<Learnt>& learnt,
                        double hidden) {
  Extent range;
  for (const Learnt& after : learnt) {
    range.Take(after.mean - kNormal95 * after.sd);
    range.Take(after.mean + kNormal95 * after.sd);
  }
  if (range.empty()) return "";
  range.Take(hidden);
  const double prior_sd = std::sqrt(parameter.variance);
  Svg svg(304, 210, "what was learnt of " + parameter.name);
  const int last = learnt.back().iteration;
  const Axis x(0, last, 66, 294),
      y(range.low - range.margin(), range.high + range.margin(), 166, 10);
  svg.Frame(x, y, "iteration", Shorten(parameter.name + " [" + parameter.unit + "]", 28),
            std::min(last + 1, 6), 5);
  svg.BeginClip(x.from(), y.to(), x.to() - x.from(), y.from() - y.to());
  Points band{{x.Pixel(0), y.Pixel(parameter.mean + kNormal95 * prior_sd)}},
      middle{{x.Pixel(0), y.Pixel(parameter.mean)}};
  for (const Learnt& after : learnt) {
    const double at = x.Pixel(after.iteration);
    band.emplace_back(at, y.Pixel(after.mean + kNormal95 * after.sd));
    middle.emplace_back(at, y.Pixel(after.mean));
  }
  for (auto after = learnt.rbegin(); after != learnt.rend(); ++after)
    band.emplace_back(x.Pixel(after->iteration), y.Pixel(after->mean - kNormal95 * after->sd));
  band.emplace_back(x.Pixel(0), y.Pixel(parameter.mean - kNormal95 * prior_sd));
  svg.Path(band, "band", true);
  svg.Path(middle, "posterior line thick");
  if (std::isfinite(hidden))
    svg.Line(x.from(), y.Pixel(hidden), x.to(), y.Pixel(hidden), "reference line");
  svg.EndClip();
  return svg.Print();
}

}  // namespace plumb
