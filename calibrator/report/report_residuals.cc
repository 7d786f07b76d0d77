#include "calibrator/report/report_residuals.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <stdexcept>

#include "calibrator/report/report_plots.h"
#include "plot/html.h"
#include "plot/svg.h"

namespace plumb {
namespace {

constexpr size_t kMaxCoordinates = 16;
constexpr int kLags = 20;

void RequireFit(const Residuals& residuals) {
  if (static_cast<size_t>(residuals.whitened.size()) != residuals.rows.size()) {
    throw std::invalid_argument(
        fmt::format("{} residuals of {} rows", residuals.whitened.size(), residuals.rows.size()));
  }
  for (const WindowErrors::Row& row : residuals.rows) {
    if (row.coordinate < 0 || static_cast<size_t>(row.coordinate) >= residuals.coordinates.size()) {
      throw std::invalid_argument("a residual of a coordinate without a name");
    }
  }
}

/// The finite residuals of each coordinate, ascending.
std::vector<std::vector<double>> ByCoordinate(const Residuals& residuals) {
  std::vector<std::vector<double>> sorted(residuals.coordinates.size());
  for (size_t i = 0; i < residuals.rows.size(); ++i) {
    const double r = residuals.whitened(static_cast<Eigen::Index>(i));
    if (std::isfinite(r)) sorted[static_cast<size_t>(residuals.rows[i].coordinate)].push_back(r);
  }
  for (auto& values : sorted) std::sort(values.begin(), values.end());
  return sorted;
}

double MeanSquare(const std::vector<double>& values) {
  if (values.empty()) return 0;
  return std::inner_product(values.begin(), values.end(), values.begin(), 0.) /
         static_cast<double>(values.size());
}

}  // namespace

std::vector<double> Autocorrelation(const Residuals& residuals, int coordinate, int lags) {
  std::map<std::pair<int, int>, double> values;  // by roll-out and transition
  double sum = 0, squares = 0;
  for (size_t i = 0; i < residuals.rows.size(); ++i) {
    const WindowErrors::Row& row = residuals.rows[i];
    const double r = residuals.whitened(static_cast<Eigen::Index>(i));
    if (row.coordinate != coordinate || !std::isfinite(r)) continue;
    values[{row.rollout, row.transition}] = r;
  }
  for (const auto& [where, r] : values) sum += r, squares += r * r;
  const double count = static_cast<double>(values.size()), mean = sum / count,
               variance = squares / count - mean * mean;
  std::vector<double> correlation;
  for (int lag = 1; lag <= lags; ++lag) {
    double product = 0, pairs = 0;
    for (const auto& [where, r] : values) {
      const auto later = values.find({where.first, where.second + lag});
      if (later == values.end()) continue;
      product += (r - mean) * (later->second - mean), ++pairs;
    }
    correlation.push_back(product / pairs / variance);
  }
  return correlation;
}

std::string ResidualPanel(const Residuals& residuals) {
  RequireFit(residuals);
  const std::vector<std::vector<double>> sorted = ByCoordinate(residuals);
  std::vector<size_t> shown;
  size_t total = 0;
  for (size_t i = 0; i < sorted.size(); ++i) {
    total += sorted[i].size();
    if (!sorted[i].empty()) shown.push_back(i);
  }
  const std::string title = "Residuals";
  if (total == 0)
    return Panel(Width::kFull, title, "Whitened one-step errors of the posterior's mean.",
                 Paragraph("There are none."));
  std::string what =
      "Whitened one-step errors of the posterior's mean. Of a model that explains the robot they "
      "are "
      "independent, with the standard normal distribution. Over the record: their root mean "
      "square; "
      "dashed lines begin a roll-out. Below, left: histogram and the standard normal density; "
      "middle: "
      "quantiles; right: autocorrelation and the band of 95 % of white noise. ";
  what += fmt::format("{} residuals", total);
  if (total < residuals.rows.size())
    what += fmt::format(", and {} without a number", residuals.rows.size() - total);
  if (shown.size() > kMaxCoordinates) {
    const size_t all = shown.size();
    std::stable_sort(shown.begin(), shown.end(), [&](size_t a, size_t b) {
      return MeanSquare(sorted[a]) > MeanSquare(sorted[b]);
    });
    shown.resize(kMaxCoordinates);
    std::sort(shown.begin(), shown.end());
    what += fmt::format("; of {} coordinates the {} with the greatest", all, kMaxCoordinates);
  }
  std::string html = Scrolling(ResidualsOverTime(residuals.whitened, residuals.rows));
  for (const size_t i : shown) {
    html += fmt::format("<h4>{}: root mean square {:.3g}, mean {:.2g}, {} residuals</h4>\n",
                        Escape(residuals.coordinates[i]), std::sqrt(MeanSquare(sorted[i])),
                        std::accumulate(sorted[i].begin(), sorted[i].end(), 0.) /
                            static_cast<double>(sorted[i].size()),
                        sorted[i].size());
    html += Row(ResidualHistogram(sorted[i]) + ResidualQuantiles(sorted[i]) +
                ResidualCorrelation(Autocorrelation(residuals, static_cast<int>(i), kLags),
                                    sorted[i].size()));
  }
  return Panel(Width::kFull, title, what + ".", html);
}

}  // namespace plumb
