#include "calibrator/report/pair_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calibrator/report/report_plots.h"
#include "common/quantile.h"
#include "plot/svg.h"

namespace plumb {
namespace {

using Points = std::vector<Eigen::Vector2d>;

// What is shown of a prior: most of it.
std::pair<double, double> PriorSpan(const Findings& findings, const ParameterDescription& p,
                                    Eigen::Index i) {
  constexpr double kSpan = 2.3;  // [sd]
  const double mean = findings.prior.mean(i), sd = std::sqrt(findings.prior.covariance(i, i));
  return {p.ToPhysical(mean - kSpan * sd), p.ToPhysical(mean + kSpan * sd)};
}

/// The numbers between which all of a parameter that matters lies.
std::pair<double, double> Extent(const Findings& findings, const Summary& summary,
                                 const ParameterDescription& p, Eigen::Index i) {
  std::vector<double> sorted(summary.samples.row(i).begin(), summary.samples.row(i).end());
  std::sort(sorted.begin(), sorted.end());
  const double low = Quantile(sorted, 0.002), high = Quantile(sorted, 0.998),
               width = std::max(high - low, 1e-12);
  const auto [prior_low, prior_high] = PriorSpan(findings, p, i);
  // Of a posterior much narrower than its prior only the surroundings: a dot would show nothing.
  constexpr double kNarrow = 8, kSurroundings = 0.8;
  if (prior_high - prior_low > kNarrow * width)
    return {low - kSurroundings * width, high + kSurroundings * width};
  return {std::min(low, prior_low), std::max(high, prior_high)};
}

class Pairs {
 public:
  Pairs(const Findings& findings, const Summary& summary, const RobotDescription& robot,
        const std::vector<Eigen::Index>& shown)
      : findings_(findings),
        summary_(summary),
        robot_(robot),
        shown_(shown),
        cell_(std::clamp(860. / static_cast<double>(shown.size()), 104., 286.)),
        svg_(Left(shown.size()) + 4, cell_ * static_cast<double>(shown.size()) + kTop + kBottom,
             "prior and posterior, parameter by parameter") {
    for (const Eigen::Index i : shown_)
      extents_.push_back(Extent(findings_, summary_, parameter(i), i));
  }

  std::string Draw() {
    for (size_t row = 0; row < shown_.size(); ++row) {
      for (size_t column = 0; column < shown_.size(); ++column) {
        if (column < row) DrawPair(row, column);
        if (column == row) DrawMarginal(row);
        if (column > row) DrawCorrelation(row, column);
      }
      DrawLabels(row);
    }
    return svg_.Print();
  }

 private:
  static constexpr double kLeft = 90, kTop = 8, kBottom = 44, kGap = 8;

  const ParameterDescription& parameter(Eigen::Index i) const {
    return robot_.parameters[static_cast<size_t>(i)];
  }
  double Left(size_t column) const { return kLeft + cell_ * static_cast<double>(column); }
  double Top(size_t row) const { return kTop + cell_ * static_cast<double>(row); }
  Axis X(size_t column) const {
    return {extents_[column].first, extents_[column].second, Left(column),
            Left(column) + cell_ - kGap};
  }
  Axis Y(size_t row) const {
    return {extents_[row].first, extents_[row].second, Top(row) + cell_ - kGap, Top(row)};
  }
  void BeginCell(size_t row, size_t column) {
    svg_.BeginClip(Left(column), Top(row), cell_ - kGap, cell_ - kGap);
  }
  void EndCell(size_t row, size_t column) {
    svg_.EndClip();
    svg_.Rectangle(Left(column), Top(row), cell_ - kGap, cell_ - kGap, "frame");
  }

  // Contours of a Gaussian of the coordinates, in the physical units of the axes.
  void DrawContours(const Gaussian& p, size_t row, size_t column, const std::string& css) {
    const Eigen::Index i = shown_[column], j = shown_[row];
    Eigen::Matrix2d covariance;
    covariance << p.covariance(i, i), p.covariance(i, j), p.covariance(j, i), p.covariance(j, j);
    const Axis x = X(column), y = Y(row);
    for (const double sigma : {1., 2.}) {
      Points points = Ellipse({p.mean(i), p.mean(j)}, covariance, sigma);
      for (Eigen::Vector2d& point : points) {
        point = {x.Pixel(parameter(i).ToPhysical(point.x())),
                 y.Pixel(parameter(j).ToPhysical(point.y()))};
      }
      svg_.Path(points, css, true);
    }
  }

  void DrawPair(size_t row, size_t column) {
    BeginCell(row, column);
    const Axis x = X(column), y = Y(row);
    for (const auto& tick : Ticks(x))
      svg_.Line(x.Pixel(tick.value), y.from(), x.Pixel(tick.value), y.to(), "grid");
    for (const auto& tick : Ticks(y))
      svg_.Line(x.from(), y.Pixel(tick.value), x.to(), y.Pixel(tick.value), "grid");
    const Eigen::Index count = std::min<Eigen::Index>(summary_.samples.cols(), 400);
    Points dots;
    for (Eigen::Index k = 0; k < count; ++k) {
      const auto sample = summary_.samples.col(k * summary_.samples.cols() / count);
      dots.emplace_back(x.Pixel(sample(shown_[column])), y.Pixel(sample(shown_[row])));
    }
    svg_.Dots(dots, "dots");
    for (const Gaussian& component : findings_.posterior.components)
      DrawContours(component, row, column, "posterior line");
    DrawContours(findings_.prior, row, column, "prior line");  // dashed: what is below still shows
    EndCell(row, column);
  }

  void DrawMarginal(size_t row) {
    const Eigen::Index i = shown_[row];
    const ParameterDescription& p = parameter(i);
    const Axis x = X(row);
    // Histogram: bins of the samples' own width.
    std::vector<double> sorted(summary_.samples.row(i).begin(), summary_.samples.row(i).end());
    std::sort(sorted.begin(), sorted.end());
    const double low = Quantile(sorted, 0.002), high = Quantile(sorted, 0.998);
    constexpr size_t kBins = 24;
    const double width = std::max((high - low) / kBins, 1e-12 * std::max(1e-12, std::abs(high)));
    std::vector<double> bins(kBins, 0);
    for (const double value : sorted) {
      if (value >= low && value <= high)
        ++bins[std::min(kBins - 1, static_cast<size_t>((value - low) / width))];
    }
    for (double& bin : bins) bin /= static_cast<double>(sorted.size()) * width;
    // The prior's density, in physical units.
    const double mean = findings_.prior.mean(i), sd = std::sqrt(findings_.prior.covariance(i, i));
    std::vector<Eigen::Vector2d> prior;
    double z = -5;
    for (int k = 0; k <= 200; ++k, z += 0.05) {
      const double step = 1e-4 * sd;
      const double slope =
          (p.ToPhysical(mean + z * sd + step) - p.ToPhysical(mean + z * sd - step)) / (2 * step);
      prior.emplace_back(p.ToPhysical(mean + z * sd), NormalDensity(z) / sd / slope);
    }
    double highest = *std::max_element(bins.begin(), bins.end());
    for (const auto& point : prior) {
      if (std::isfinite(point.y())) highest = std::max(highest, point.y());
    }
    const double room = WithinPrior(row) ? 1.4 : 1.08;  // above the bars
    const Axis y(0, highest * room, Top(row) + cell_ - kGap, Top(row));
    BeginCell(row, row);
    for (size_t k = 0; k < kBins; ++k) {
      const double from = x.Pixel(low + width * static_cast<double>(k));
      svg_.Rectangle(from, y.Pixel(bins[k]),
                     x.Pixel(low + width * static_cast<double>(k + 1)) - from,
                     y.from() - y.Pixel(bins[k]), "posterior bar");
    }
    for (auto& point : prior) point = {x.Pixel(point.x()), y.Pixel(point.y())};
    svg_.Path(prior, "prior line");
    EndCell(row, row);
    DrawWithinPrior(row);
  }

  bool WithinPrior(size_t row) const {
    const auto [low, high] = PriorSpan(findings_, parameter(shown_[row]), shown_[row]);
    return extents_[row].first > low || extents_[row].second < high;
  }

  // Of a posterior that is shown at a scale of its own: where it is in its prior.
  void DrawWithinPrior(size_t row) {
    const Eigen::Index i = shown_[row];
    const ParameterDescription& p = parameter(i);
    if (!WithinPrior(row)) return;
    const auto [low, high] = PriorSpan(findings_, p, i);
    constexpr double kInset = 10, kRule = 12, kLeast = 2.5;
    const Axis whole(low, high, X(row).from() + kInset, X(row).to() - kInset);
    const double at = Top(row) + kRule;
    const auto pixel = [&, low = low, high = high](double value) {
      return whole.Pixel(std::clamp(value, low, high));
    };
    svg_.Line(whole.from(), at, whole.to(), at, "prior line");
    const double from = pixel(summary_.lower(i)), to = pixel(summary_.upper(i));
    const double width = std::max(kLeast, to - from);
    svg_.Rectangle((from + to - width) / 2, at - 4, width, 8, "posterior mark");
    const double ratio = summary_.prior_sd(i) / summary_.sd(i);
    if (std::isfinite(ratio) && ratio >= 2) {
      svg_.Text(X(row).from() + kInset, at + 18,
                fmt::format("{:.4g} times narrower", std::round(ratio)), "tick",
                Svg::Anchor::kStart);
    }
  }

  void DrawCorrelation(size_t row, size_t column) {
    const Eigen::MatrixXd& c = summary_.coordinates.covariance;
    const Eigen::Index i = shown_[row], j = shown_[column];
    const double correlation = c(i, j) / std::sqrt(c(i, i) * c(j, j));
    const bool strong = std::abs(correlation) >= 0.5;
    svg_.Text(Left(column) + (cell_ - kGap) / 2, Top(row) + (cell_ - kGap) / 2 + 5,
              fmt::format("{:+.2f}", correlation), strong ? "large" : "large muted");
  }

  // As many as there is room for: labels keep clear of each other and of the next cell's.
  std::vector<Axis::Tick> Ticks(const Axis& axis) const {
    const double begin = std::min(axis.from(), axis.to()), end = std::max(axis.from(), axis.to());
    std::vector<Axis::Tick> ticks;
    for (int count = cell_ < 150 ? 3 : 6; count >= 2; --count) {
      ticks = axis.Ticks(count);
      double width = 22;  // also of what is as high as a line
      for (const auto& tick : ticks)
        width = std::max(width, 6.5 * static_cast<double>(tick.label.size()));
      std::erase_if(ticks, [&](const auto& t) {
        const double at = axis.Pixel(t.value);
        return at < begin + width / 2 - kGap / 2 || at > end - width / 2 + kGap / 2;
      });
      if (ticks.size() < 2 ||
          std::abs(axis.Pixel(ticks[1].value) - axis.Pixel(ticks[0].value)) > width + 8)
        break;
    }
    return ticks;
  }

  void DrawLabels(size_t k) {
    const Axis x = X(k), y = Y(k);
    const double bottom = Top(shown_.size()) - kGap;
    const auto length = static_cast<size_t>((cell_ - 2 * kGap) / 7);
    const std::string full = WithUnit(parameter(shown_[k]));
    const std::string name =
        full.size() <= length ? full : Shorten(parameter(shown_[k]).name, length);
    for (const auto& tick : Ticks(x))
      svg_.Text(x.Pixel(tick.value), bottom + 15, tick.label, "tick");
    svg_.Text((x.from() + x.to()) / 2, bottom + 35, name);
    if (k > 0) {
      for (const auto& tick : Ticks(y))
        svg_.Text(kLeft - 6, y.Pixel(tick.value) + 4, tick.label, "tick", Svg::Anchor::kEnd);
    }
    svg_.Text(14, (y.from() + y.to()) / 2, name, "label", Svg::Anchor::kMiddle, -90);
  }

  const Findings& findings_;
  const Summary& summary_;
  const RobotDescription& robot_;
  const std::vector<Eigen::Index>& shown_;
  double cell_;
  Svg svg_;
  std::vector<std::pair<double, double>> extents_;
};

}  // namespace

std::string PairPlot(const Findings& findings, const Summary& summary,
                     const RobotDescription& robot, const std::vector<Eigen::Index>& shown) {
  return Pairs(findings, summary, robot, shown).Draw();
}

}  // namespace plumb
