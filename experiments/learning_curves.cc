// How training goes, over several seeds: a table, a plot with the seeds' band, and a sentence.
//
//   plumb-learning-curves robots/hopper/gym.toml --steps 1e6 --output curves
//
// A seed that the table already has is not run again: an interrupted experiment goes on with the
// others.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <limits>
#include <map>
#include <numeric>

#include "common/atomic_file.h"
#include "common/examples.h"
#include "common/process.h"
#include "common/progress_line.h"
#include "common/special_numbers.h"
#include "common/time_units.h"
#include "experiments/options.h"
#include "experiments/provenance.h"
#include "experiments/results.h"
#include "plot/svg.h"
#include "robot/parameter_distribution.h"
#include "trainer/robot_simulation.h"
#include "trainer/trainer.h"

namespace plumb {
namespace {

using Eigen::Vector2d;

constexpr int kEvaluationEpisodes = 100;  // of the final policy
constexpr int kSmoothed = 5;              // batches
constexpr int kLastBatches = 10;

struct Options {
  std::string robot, output = ".", distribution = "nominal";
  int seeds = 5, threads = 0;
  double steps = 0, threshold = kNaN;
  bool paper = false;
};

/// A row for each update; the last one has an evaluation.
struct Curve {
  std::vector<double> steps, returns;
  double evaluation = 0, seconds = 0;

  double Smoothed(size_t i) const {
    const size_t first = i + 1 < kSmoothed ? 0 : i + 1 - kSmoothed;
    return std::accumulate(returns.begin() + static_cast<ptrdiff_t>(first),
                           returns.begin() + static_cast<ptrdiff_t>(i) + 1, 0.) /
           static_cast<double>(i + 1 - first);
  }
  double last() const {
    const size_t count = std::min<size_t>(kLastBatches, returns.size());
    return std::accumulate(returns.end() - static_cast<ptrdiff_t>(count), returns.end(), 0.) /
           static_cast<double>(count);
  }
  /// The first number of steps at which the smoothed return is at least that; infinite if it never
  /// is.
  double Reached(double threshold) const {
    for (size_t i = kSmoothed - 1; i < returns.size(); ++i) {
      if (Smoothed(i) >= threshold) return steps[i];
    }
    return std::numeric_limits<double>::infinity();
  }
  /// Smoothed return at some number of steps, interpolated; NaN before the first and after the
  /// last.
  double At(double step) const {
    const auto above = std::lower_bound(steps.begin(), steps.end(), step);
    if (above == steps.begin() || above == steps.end()) return kNaN;
    const auto i = static_cast<size_t>(above - steps.begin());
    const double share = (step - steps[i - 1]) / (steps[i] - steps[i - 1]);
    return (1 - share) * Smoothed(i - 1) + share * Smoothed(i);
  }
};

using Curves = std::map<int, Curve>;  // by seed

Results::Rows RowsOf(const Curve& curve) {
  Results::Rows rows;
  for (size_t i = 0; i < curve.steps.size(); ++i) {
    const bool last = i + 1 == curve.steps.size();
    rows.push_back({curve.steps[i], curve.returns[i], last ? curve.evaluation : kNaN,
                    last ? curve.seconds : kNaN});
  }
  return rows;
}

Curve CurveOf(const Results::Rows& rows) {
  Curve curve;
  for (const std::vector<double>& row : rows) {
    curve.steps.push_back(row[0]), curve.returns.push_back(row[1]);
    curve.evaluation = row[2], curve.seconds = row[3];
  }
  return curve;
}

/// @return an incomplete curve if the process was asked to stop.
Curve Train(const RobotDescription& robot, const ParameterDistribution& distribution, int64_t steps,
            int seed, int threads, Process& process) {
  Trainer trainer(robot.training, SimulateRobot(robot), robot.effort_limits(),
                  static_cast<uint64_t>(seed), threads);
  const ParameterSampler sample = [&](Random& random) { return distribution.Sample(random); };
  const auto start = std::chrono::steady_clock::now();
  Curve curve;
  ProgressLine line;
  while (trainer.steps() < steps && !process.stopping()) {
    curve.returns.push_back(trainer.Update(sample).mean_return);
    curve.steps.push_back(static_cast<double>(trainer.steps()));
    if (trainer.updates() % 25 == 0) {
      line.Show(
          fmt::format("seed {}: {:.0f} %, return {:.5g}", seed,
                      100. * static_cast<double>(trainer.steps()) / static_cast<double>(steps),
                      curve.returns.back()));
    }
  }
  line.Clear();
  curve.seconds = SecondsSince(start);
  curve.evaluation = trainer.EvaluateHeldOut(sample, kEvaluationEpisodes).mean;
  return curve;
}

constexpr char kRules[] =
    R"(.band { fill: #1f5fbf; fill-opacity: 0.14; stroke: none; }
.seed { fill: none; stroke: #1f5fbf; stroke-opacity: 0.35; }
.dot { fill: #1f5fbf; }
.mean { fill: none; stroke: #1f5fbf; stroke-width: 2.2; }
)";

std::string Draw(const Curves& curves, double steps, const std::string& title) {
  constexpr double kWidth = 640, kHeight = 360, kLeft = 70, kRight = 626, kTop = 34, kBottom = 312;
  constexpr int kPoints = 200;
  std::vector<double> grid, low, high, mean;
  for (int k = 1; k < kPoints; ++k) {
    const double at = steps * k / kPoints;
    double sum = 0, least = INFINITY, most = -INFINITY;
    for (const auto& [seed, curve] : curves) {
      const double value = curve.At(at);
      sum += value, least = std::min(least, value), most = std::max(most, value);
    }
    if (!std::isfinite(sum)) continue;
    grid.push_back(at), low.push_back(least), high.push_back(most),
        mean.push_back(sum / static_cast<double>(curves.size()));
  }
  const bool one_batch = grid.empty();
  if (one_batch) {  // of each seed, which is a point and no curve
    for (const auto& [seed, curve] : curves) {
      for (auto* list : {&low, &high, &mean}) list->push_back(curve.last());
      grid.push_back(curve.steps.back());
      steps = std::max(steps, grid.back());
    }
  }
  Svg svg(kWidth, kHeight, title);
  svg.Rectangle(0, 0, kWidth, kHeight, "paper");
  svg.Text(kLeft, 20, title, "label", Svg::Anchor::kStart);
  const Axis x(0, steps, kLeft, kRight),
      y(std::min(0., *std::min_element(low.begin(), low.end())),
        std::max(0., *std::max_element(high.begin(), high.end())), kBottom, kTop);
  svg.Frame(x, y, "simulated steps", "return", 6, 6);
  for (size_t i = 0; one_batch && i < grid.size(); ++i)
    svg.Circle(x.Pixel(grid[i]), y.Pixel(mean[i]), 3, "dot");
  std::vector<Vector2d> band, line;
  if (one_batch) grid.clear();
  for (size_t i = 0; i < grid.size(); ++i) band.emplace_back(x.Pixel(grid[i]), y.Pixel(high[i]));
  for (size_t i = grid.size(); i-- > 0;) band.emplace_back(x.Pixel(grid[i]), y.Pixel(low[i]));
  svg.Path(band, "band", true);
  for (const auto& [seed, curve] : curves) {
    std::vector<Vector2d> points;
    points.reserve(grid.size());
    for (const double at : grid) points.emplace_back(x.Pixel(at), y.Pixel(curve.At(at)));
    svg.Path(points, "seed");
  }
  for (size_t i = 0; i < grid.size(); ++i) line.emplace_back(x.Pixel(grid[i]), y.Pixel(mean[i]));
  svg.Path(line, "mean");
  return svg.PrintAlone(kRules);
}

template <class F>
std::string Each(const Curves& curves, const std::string& format, F&& value) {
  std::string text;
  for (const auto& [seed, curve] : curves)
    text += (text.empty() ? "" : " ") + fmt::format(fmt::runtime(format), value(curve));
  return text;
}

std::string Sentence(const RobotDescription& robot, int64_t steps, const Curves& curves,
                     double threshold) {
  double mean = 0;
  for (const auto& [seed, curve] : curves)
    mean += curve.evaluation / static_cast<double>(curves.size());
  std::string text = fmt::format(
      "{}, {} steps, {} seeds: return without exploration {:.0f} (each {}); of the last {} batches "
      "{}",
      robot.name, steps, curves.size(), mean,
      Each(curves, "{:.0f}", [](const Curve& c) { return c.evaluation; }), kLastBatches,
      Each(curves, "{:.0f}", [](const Curve& c) { return c.last(); }));
  if (std::isfinite(threshold)) {
    text +=
        fmt::format("; {} reached after {} steps", threshold,
                    Each(curves, "{:.0f}", [&](const Curve& c) { return c.Reached(threshold); }));
  }
  return text +
         fmt::format("; {} s\n", Each(curves, "{:.1f}", [](const Curve& c) { return c.seconds; }));
}

int RunSeeds(Process& process, const Options& options) {
  RobotDescription robot = LoadRobot(options.robot);
  if (options.paper) robot.training = PaperSettings(robot.training);
  const ParameterDistribution distribution = options.distribution == "nominal"
                                                 ? ParameterDistribution::Nominal(robot)
                                                 : ParameterDistribution::Prior(robot);
  const auto steps = options.steps > 0
                         ? static_cast<int64_t>(options.steps)
                         : int64_t{robot.training.first_updates()} * robot.training.batch;

  const std::filesystem::path folder = options.output;
  const std::string settings =
      fmt::format("{}, {} steps, {} simulators{}, {}", robot.name, steps, options.distribution,
                  options.paper ? ", the paper's settings" : "", Provenance({robot}));
  Results results(folder / "learning_curves.csv", settings, {"seed"},
                  {"steps", "mean_return", "evaluation_return", "seconds"});
  Curves curves;
  for (int seed = 1; seed <= options.seeds; ++seed) {
    const std::string key = std::to_string(seed);
    if (!results.Has(key)) {
      const Curve curve = Train(robot, distribution, steps, seed, options.threads, process);
      if (process.stopping()) return 130;
      results.Add(key, RowsOf(curve));
    }
    curves[seed] = CurveOf(results.Of(key));
  }
  const std::string title = fmt::format(
      "{}, {} simulators, {} seeds{}: mean return of a batch, band from the worst to the best seed",
      robot.name, options.distribution, curves.size(),
      options.paper ? ", the paper's settings" : "");
  WriteAtomically(folder / "learning_curves.svg", Draw(curves, static_cast<double>(steps), title));
  std::cout << Sentence(robot, steps, curves, options.threshold);
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  plumb::Options options;
  return plumb::Run(
      "plumb-learning-curves", "How training goes, over several seeds.", argc, argv,
      [&](CLI::App& app) {
        app.add_option("robot", options.robot, "robot folder or TOML file")->required();
        plumb::AddOutputFlag(app, options.output, "learning_curves.csv and learning_curves.svg");
        plumb::AddCountFlag(app, "--seeds", options.seeds, "how many, from 1");
        app.add_option("--steps", options.steps,
                       "to simulate; default: updates x batch of robot.toml")
            ->check(CLI::Range(1.0, 1e15));
        app.add_option("--distribution", options.distribution, "of simulators")
            ->check(CLI::IsMember({"nominal", "prior"}))
            ->capture_default_str();
        app.add_option("--threshold", options.threshold,
                       "return to say when it is reached, over 5 batches");
        plumb::AddThreadsFlag(app, options.threads);
        app.add_flag("--paper", options.paper, "the paper's settings");
        plumb::AddExamples(app, {"plumb-learning-curves robots/pendulum/gym.toml"});
      },
      [&](plumb::Process& process) { return plumb::RunSeeds(process, options); });
}
