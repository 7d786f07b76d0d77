#include "plot/curves.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>

#include "plot/svg.h"

namespace plumb {
namespace {

using Eigen::Vector2d;

// of a chart
constexpr double kWidth = 380, kHeight = 300, kLeft = 62, kGap = 14, kTop = 30, kBelow = 46;
constexpr size_t kAbreast = 2;
constexpr double kLegendRow = 20, kLegendColumn = 300;

// From the eleventh curve on colours come again, with dashes.
constexpr size_t kColours = 10;
constexpr char kRules[] =
    R"(.band { stroke: none; fill-opacity: 0.12; } .line { fill: none; stroke-width: 2; }
.line.c0 { stroke: #0072b2; } .line.c1 { stroke: #d55e00; } .line.c2 { stroke: #009e73; }
.line.c3 { stroke: #cc79a7; }
.line.c4 { stroke: #5b6676; stroke-dasharray: 5 3; }
.line.c5 { stroke: #1b2330; stroke-dasharray: 2 3; } .line.c6 { stroke: #e69f00; }
.line.c7 { stroke: #56b4e9; }
.line.c8 { stroke: #800000; } .line.c9 { stroke: #4b0082; }
.band.c0 { fill: #0072b2; } .band.c1 { fill: #d55e00; } .band.c2 { fill: #009e73; }
.band.c3 { fill: #cc79a7; }
.band.c4 { fill: #5b6676; } .band.c5 { fill: #1b2330; } .band.c6 { fill: #e69f00; }
.band.c7 { fill: #56b4e9; }
.band.c8 { fill: #800000; } .band.c9 { fill: #4b0082; }
.line.again { stroke-dasharray: 8 3 2 3; }
)";

std::string ClassOf(size_t curve) {
  return fmt::format("c{}{}", curve % kColours, curve < kColours ? "" : " again");
}

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void Take(double value, bool logarithmic) {
    if (!std::isfinite(value) || (logarithmic && !(value > 0))) return;
    low = std::min(low, value), high = std::max(high, value);
  }
};

void DrawChart(const Chart& chart, double left, double top, Svg& svg) {
  Range x_range, y_range;
  for (const Curve& curve : chart.curves) {
    for (const double x : curve.x) x_range.Take(x, chart.logarithmic_x);
    for (const auto* values : {&curve.middle, &curve.low, &curve.high}) {
      for (const double y : *values) y_range.Take(y, chart.logarithmic);
    }
  }
  svg.Text(left + kLeft, top + kTop - 10, chart.title, "name", Svg::Anchor::kStart);
  if (!(x_range.low <= x_range.high) || !(y_range.low <= y_range.high)) return;
  const double right = left + kWidth - kGap, bottom = top + kHeight - kBelow;
  const double margin = chart.logarithmic ? 0 : 0.03 * (y_range.high - y_range.low);
  const Axis x(x_range.low, x_range.high, left + kLeft, right, chart.logarithmic_x);
  const Axis y(y_range.low - margin, y_range.high + margin, bottom, top + kTop, chart.logarithmic);
  svg.Frame(x, y, chart.x_label, chart.y_label, 6, 6);
  svg.BeginClip(left + kLeft, top + kTop, right - left - kLeft, bottom - top - kTop);
  for (size_t c = 0; c < chart.curves.size(); ++c) {
    const Curve& curve = chart.curves[c];
    const auto pixel = [&](size_t i, double value) {
      return Vector2d(x.Pixel(curve.x[i]), y.Pixel(value));
    };
    std::vector<Vector2d> band, line;
    for (size_t i = 0; i < curve.x.size(); ++i) {
      if (std::isfinite(curve.high[i])) band.push_back(pixel(i, curve.high[i]));
    }
    for (size_t i = curve.x.size(); i-- > 0;) {
      if (std::isfinite(curve.low[i]))
        band.push_back(
            pixel(i, chart.logarithmic ? std::max(curve.low[i], y.lower()) : curve.low[i]));
    }
    for (size_t i = 0; i < curve.x.size(); ++i) line.push_back(pixel(i, curve.middle[i]));
    const std::string colour = " " + ClassOf(c);
    if (!band.empty()) svg.Path(band, "band" + colour, true);
    svg.Path(line, "line" + colour);
  }
  svg.EndClip();
}

}  // namespace

std::string DrawCurves(const std::string& title, const std::vector<Chart>& charts) {
  const size_t abreast = std::min(charts.size(), kAbreast);
  const double width = kWidth * static_cast<double>(abreast),
               height = kHeight * std::ceil(static_cast<double>(charts.size()) / kAbreast);
  const auto columns = static_cast<size_t>(std::max(1.0, std::floor(width / kLegendColumn)));
  const std::vector<Curve>& curves = charts.at(0).curves;
  const size_t rows = (curves.size() + columns - 1) / columns;
  const double legend = kLegendRow * static_cast<double>(rows) + 6;
  Svg svg(width, legend + height, title);
  svg.Rectangle(0, 0, width, legend + height, "paper");
  for (size_t c = 0; c < curves.size(); ++c) {
    const size_t row = c / columns;
    const double left = 14 + kLegendColumn * static_cast<double>(c % columns),
                 y = 16 + kLegendRow * static_cast<double>(row);
    svg.Line(left, y - 4, left + 26, y - 4, "line " + ClassOf(c));
    svg.Text(left + 33, y, curves[c].name, "label", Svg::Anchor::kStart);
  }
  for (size_t p = 0; p < charts.size(); ++p) {
    const size_t row = p / kAbreast;
    DrawChart(charts[p], kWidth * static_cast<double>(p % kAbreast),
              legend + kHeight * static_cast<double>(row), svg);
  }
  return svg.PrintAlone(kRules);
}

Band ConfidenceBand(const std::vector<double>& values, bool logarithmic) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const auto forth = [&](double x) { return logarithmic ? std::log(x) : x; };
  const auto back = [&](double x) { return logarithmic ? std::exp(x) : x; };
  const auto n = static_cast<double>(values.size());
  if (values.empty()) return {kNone, kNone, kNone};
  double mean = 0, squares = 0;
  for (const double value : values) mean += forth(value) / n;
  if (values.size() == 1) return {back(mean), kNone, kNone};
  for (const double value : values) squares += (forth(value) - mean) * (forth(value) - mean);
  const double t = boost::math::quantile(boost::math::students_t(n - 1), 0.975);
  const double half = t * std::sqrt(squares / (n - 1) / n);
  return {back(mean), back(mean - half), back(mean + half)};
}

}  // namespace plumb
