#include "calibrator/report/report_plots.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <map>

#include "calibrator/diagnostics/identifiability.h"
#include "plot/curves.h"
#include "plot/svg.h"
#include "robot/coordinate_names.h"

namespace plumb {
namespace {

using Points = std::vector<Eigen::Vector2d>;

// The small plots: where they are drawn.
constexpr double kWidth = 304, kHeight = 210, kLeft = 66, kRight = 294, kTop = 10, kBottom = 166;

}  // namespace

double NormalDensity(double z) { return std::exp(-z * z / 2) / std::sqrt(2 * M_PI); }

std::string ErrorPlot(const std::vector<HorizonError>& errors) {
  double low = INFINITY, high = 0, first = INFINITY, last = 0;
  for (const HorizonError& e : errors) {
    for (const double error : {e.posterior, e.prior}) {
      if (!(error > 0) || !std::isfinite(error) || e.horizon < 1) continue;
      low = std::min(low, error), high = std::max(high, error);
      first = std::min(first, static_cast<double>(e.horizon)),
      last = std::max(last, static_cast<double>(e.horizon));
    }
  }
  if (!(high > 0)) return "";
  Svg svg(440, 310, "error of prediction against the number of steps");
  const Axis x(first / 1.15, last * 1.15, 70, 428, true), y(low / 1.4, high * 1.4, 264, 12, true);
  svg.Frame(x, y, "steps ahead", "error, standard units", 6, 6);
  for (const bool prior : {true, false}) {
    const std::string css = prior ? "prior" : "posterior";
    Points points;
    for (const HorizonError& e : errors) {
      const double error = prior ? e.prior : e.posterior;
      if (!(error > 0) || !std::isfinite(error) || e.horizon < 1) continue;
      points.emplace_back(x.Pixel(e.horizon), y.Pixel(error));
    }
    svg.Path(points, css + " line thick");
    for (const auto& point : points) svg.Circle(point.x(), point.y(), 3.5, css + " mark");
  }
  return svg.Print();
}

std::string ScreePlot(const std::vector<double>& eigenvalues) {
  const double highest = eigenvalues.empty() ? NAN : eigenvalues.front();
  if (!(highest > 0) || !std::isfinite(highest)) return "";
  const double null = NullInformation(highest);
  double lowest = std::min(1., null);
  for (const double value : eigenvalues) {
    if (value > 0) lowest = std::min(lowest, value);
  }
  lowest = std::max(lowest, highest * 1e-15);  // rounding
  const auto count = static_cast<double>(eigenvalues.size());
  Svg svg(440, 280, "eigenvalues of the Fisher information in units of the prior");
  const double range = std::max(1., highest) / lowest;
  const Axis x(0.5, count + 0.5, 70, 428);
  const Axis y(lowest / std::pow(range, 0.04),
               std::max(1., highest) * std::max(2., std::pow(range, 0.05)), 246, 12, true);
  svg.Frame(x, y, "", "information", 1, 8);
  svg.Line(x.from(), y.Pixel(1), x.to(), y.Pixel(1), "prior line");
  svg.Line(x.from(), y.Pixel(null), x.to(), y.Pixel(null), "limit");
  const double width = std::min(46., 0.6 * (x.to() - x.from()) / count);
  for (size_t i = 0; i < eigenvalues.size(); ++i) {
    const double at = x.Pixel(static_cast<double>(i + 1)),
                 top = y.Pixel(std::max(eigenvalues[i], y.lower()));
    svg.Rectangle(at - width / 2, top, width, y.from() - top, "posterior bar");
    if (count <= 20) svg.Text(at, y.from() + 16, std::to_string(i + 1), "tick");
  }
  return svg.Print();
}

std::string ResidualHistogram(const std::vector<double>& residuals) {
  constexpr int kBins = 40;
  constexpr double kEnd = 5, kBin = 2 * kEnd / kBins;
  std::vector<double> bins(kBins, 0);
  for (const double r : residuals) {  // what is beyond the ends is in the last bins
    ++bins[static_cast<size_t>(std::clamp(
        static_cast<int>(std::floor((std::clamp(r, -kEnd, kEnd) + kEnd) / kBin)), 0, kBins - 1))];
  }
  for (double& bin : bins) bin /= kBin * std::max<double>(1, static_cast<double>(residuals.size()));
  Svg svg(kWidth, kHeight, "histogram of residuals");
  const Axis x(-kEnd, kEnd, kLeft, kRight);
  const Axis y(0, 1.1 * std::max(NormalDensity(0), *std::max_element(bins.begin(), bins.end())),
               kBottom, kTop);
  svg.Frame(x, y, "residual [sd]", "density", 6, 4);
  for (int k = 0; k < kBins; ++k) {
    const double from = x.Pixel(-kEnd + k * kBin), top = y.Pixel(bins[static_cast<size_t>(k)]);
    svg.Rectangle(from, top, x.Pixel(-kEnd + (k + 1) * kBin) - from, y.from() - top,
                  "posterior bar");
  }
  Points normal;
  double z = -kEnd;
  for (int k = 0; k <= 100; ++k, z += 0.1)
    normal.emplace_back(x.Pixel(z), y.Pixel(NormalDensity(z)));
  svg.Path(normal, "reference line");
  return svg.Print();
}

std::string ResidualQuantiles(const std::vector<double>& sorted) {
  Svg svg(kWidth, kHeight, "quantiles of residuals against those of a normal distribution");
  double end = 4;
  for (const double r : {sorted.empty() ? 0 : sorted.front(), sorted.empty() ? 0 : sorted.back()}) {
    end = std::max(end, std::min(std::abs(r), 12.));
  }
  const Axis x(-4, 4, kLeft, kRight), y(-end, end, kBottom, kTop);
  svg.Frame(x, y, "normal quantile", "residual [sd]", 5, 5);
  svg.BeginClip(kLeft, kTop, kRight - kLeft, kBottom - kTop);
  svg.Line(x.Pixel(-4), y.Pixel(-4), x.Pixel(4), y.Pixel(4), "reference line");
  const size_t count = std::min<size_t>(sorted.size(), 200);
  Points dots;
  for (size_t k = 0; k < count; ++k) {
    const size_t i = count < 2 ? 0 : k * (sorted.size() - 1) / (count - 1);
    const double share = (static_cast<double>(i) + 0.5) / static_cast<double>(sorted.size());
    dots.emplace_back(x.Pixel(boost::math::quantile(boost::math::normal(), share)),
                      y.Pixel(std::clamp(sorted[i], -end, end)));
  }
  svg.Dots(dots, "dots strong");
  svg.EndClip();
  return svg.Print();
}

std::string ResidualCorrelation(const std::vector<double>& correlation, size_t count) {
  Svg svg(kWidth, kHeight, "autocorrelation of residuals");
  const double band = count > 0 ? kNormal95 / std::sqrt(static_cast<double>(count)) : 0;
  double end = std::max(0.25, 1.3 * band);
  for (const double c : correlation) {
    if (std::isfinite(c)) end = std::max(end, 1.15 * std::abs(c));
  }
  end = std::min(end, 1.05);
  const Axis x(0, static_cast<double>(correlation.size()) + 1, kLeft, kRight),
      y(-end, end, kBottom, kTop);
  svg.Frame(x, y, "lag [steps]", "autocorrelation", 5, 5);
  svg.Rectangle(kLeft, y.Pixel(std::min(band, end)), kRight - kLeft,
                y.Pixel(-std::min(band, end)) - y.Pixel(std::min(band, end)), "band");
  svg.Line(kLeft, y.Pixel(0), kRight, y.Pixel(0), "axis");
  for (size_t k = 0; k < correlation.size(); ++k) {
    const double at = x.Pixel(static_cast<double>(k + 1));
    svg.Line(at, y.Pixel(0), at, y.Pixel(correlation[k]), "posterior line thick");
  }
  return svg.Print();
}

std::string ResidualsOverTime(const Eigen::VectorXd& residuals,
                              const std::vector<WindowErrors::Row>& rows) {
  struct Sum {
    double squares = 0;
    double count = 0;
  };
  std::map<std::pair<int, int>, Sum> transitions;  // in the order of the record
  for (size_t i = 0; i < rows.size(); ++i) {
    const double r = residuals(static_cast<Eigen::Index>(i));
    if (!std::isfinite(r)) continue;
    Sum& sum = transitions[{rows[i].rollout, rows[i].transition}];
    sum.squares += r * r, ++sum.count;
  }
  if (transitions.empty()) return "";
  const size_t total = transitions.size(), bins = std::min<size_t>(total, 120);
  std::vector<Sum> binned(bins);
  std::vector<double> begins;
  size_t at = 0;
  int rollout = transitions.begin()->first.first;
  for (const auto& [where, sum] : transitions) {
    Sum& bin = binned[at * bins / total];
    bin.squares += sum.squares, bin.count += sum.count;
    if (where.first != rollout) begins.push_back(static_cast<double>(at)), rollout = where.first;
    ++at;
  }
  double highest = 2;
  for (const Sum& bin : binned)
    highest = std::max(highest, 1.1 * std::sqrt(bin.squares / bin.count));
  Svg svg(920, 250, "residuals over the record");
  const Axis x(0, static_cast<double>(total), 70, 906), y(0, highest, 204, 12);
  svg.Frame(x, y, "transition", "rms [sd]", 8, 5);
  if (begins.size() <= 100) {
    for (const double begin : begins)
      svg.Line(x.Pixel(begin), y.from(), x.Pixel(begin), y.to(), "limit");
  }
  svg.Line(x.from(), y.Pixel(1), x.to(), y.Pixel(1), "reference line");
  Points points;
  for (size_t k = 0; k < bins; ++k) {
    const double middle =
        (static_cast<double>(k) + 0.5) * static_cast<double>(total) / static_cast<double>(bins);
    points.emplace_back(x.Pixel(middle), y.Pixel(std::sqrt(binned[k].squares / binned[k].count)));
  }
  svg.Path(points, "posterior line thick");
  return svg.Print();
}

std::string ErrorsLeftPlot(const ResidualQuality& quality, const RobotDescription& robot,
                           const std::string& condition) {
  constexpr double kRow = 20, kNames = 120;
  const Eigen::Index count = quality.before.size();
  const double bottom = kTop + kRow * static_cast<double>(count) + 6;
  Svg svg(kNames + kWidth, bottom + 44, "what the residual leaves of the errors, " + condition);
  const Axis x(0, 1, kNames + 10, kNames + kRight), y(0, 1, bottom, kTop);
  svg.Frame(x, y, condition + ", error left", "", 4);
  const std::vector<std::string> names = CoordinateNames(robot).v;
  for (Eigen::Index i = 0; i < count; ++i) {
    const double at = kTop + 3 + kRow * (static_cast<double>(i) + 0.5),
                 before = std::max(quality.before(i), 1e-300);
    svg.Text(kNames + 4, at + 4, Shorten(names[static_cast<size_t>(i)], 18), "tick",
             Svg::Anchor::kEnd);
    const double left = std::min(1.0, quality.after(i) / before),
                 readings = std::min(1.0, quality.claimed(i) / before);
    svg.Rectangle(x.from(), at - 6, x.Pixel(left) - x.from(), 12, "posterior bar");
    svg.Line(x.Pixel(readings), at - 8, x.Pixel(readings), at + 8, "reference line");
  }
  return svg.Print();
}

std::string AgreementPlot(const std::vector<LogAgreement>& logs, const Summary& summary,
                          const RobotDescription& robot, Eigen::Index parameter) {
  const auto fits = [&](const LogAgreement& l) {
    return parameter < l.mean.size() && parameter < l.sd.size() &&
           std::isfinite(l.mean(parameter)) && std::isfinite(l.sd(parameter));
  };
  double low = summary.lower(parameter), high = summary.upper(parameter);
  for (const LogAgreement& l : logs) {
    if (!fits(l)) continue;
    low = std::min(low, l.mean(parameter) - 2.2 * l.sd(parameter));
    high = std::max(high, l.mean(parameter) + 2.2 * l.sd(parameter));
  }
  constexpr double kRow = 20;
  const double bottom = kTop + kRow * static_cast<double>(logs.size()) + 6;
  Svg svg(kWidth, bottom + 44,
          "what each log says of " + robot.parameters[static_cast<size_t>(parameter)].name);
  const Axis x(low, high, 30, kRight), y(0, 1, bottom, kTop);
  svg.Frame(x, y, Shorten(WithUnit(robot.parameters[static_cast<size_t>(parameter)]), 36), "", 4);
  const double from = x.Pixel(summary.lower(parameter)), to = x.Pixel(summary.upper(parameter));
  svg.Rectangle(from, kTop, std::max(2., to - from), bottom - kTop, "band");
  for (size_t k = 0; k < logs.size(); ++k) {
    const double at = kTop + 3 + kRow * (static_cast<double>(k) + 0.5);
    svg.Text(22, at + 4, std::to_string(k + 1), "tick", Svg::Anchor::kEnd);
    if (!fits(logs[k])) continue;
    const double mean = logs[k].mean(parameter), reach = kNormal95 * logs[k].sd(parameter);
    svg.Line(x.Pixel(mean - reach), at, x.Pixel(mean + reach), at, "posterior line thick");
    svg.Circle(x.Pixel(mean), at, 3.5, "posterior mark");
  }
  return svg.Print();
}

}  // namespace plumb
