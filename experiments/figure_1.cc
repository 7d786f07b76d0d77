// Figure 1 of "step-based SimOpt": which simulators explain a robot that is not one simulator but
// two: experiments/two_payloads.h. Prior of xi: N(0, 1).
//
//   plumb-figure-1 --output figure_1
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <cmath>
#include <filesystem>
#include <iostream>

#include "calibrator/inference/conditional_mixture.h"
#include "calibrator/inference/reps_search.h"
#include "common/atomic_file.h"
#include "common/examples.h"
#include "common/gaussian.h"
#include "experiments/jobs.h"
#include "experiments/options.h"
#include "experiments/population_weights.h"
#include "experiments/provenance.h"
#include "experiments/two_payloads.h"
#include "plot/svg.h"

namespace plumb {
namespace {

using Eigen::Index, Eigen::Vector2d, Eigen::VectorXd;

constexpr double kNear = 0.2;  // of a mode

// First stream words.
constexpr uint32_t kRobot = 1, kSimulators = 2, kSimulation = 3;

/// A distribution over simulators: weighted xi.
struct Found {
  VectorXd xi, weights;  // sum to 1
  double width;          // of the kernel that it is drawn with

  double mean() const { return xi.dot(weights); }
  double sd() const { return std::sqrt((xi.array() - mean()).square().matrix().dot(weights)); }
  double Near(double mode) const {
    return ((xi.array() - mode).abs() < kNear).select(weights, 0).sum();
  }
  double Density(double x) const {
    const auto kernel = (-0.5 * ((xi.array() - x) / width).square()).exp();
    return (weights.array() * kernel).sum() / (width * std::sqrt(2 * M_PI));
  }
};

Prior OfXi() { return Prior({Prior::Normal(0, 1)}); }

// SimOpt's strategy: the mean squared error, and a Gaussian that searches where it is small.
Gaussian BySquaredError(const std::vector<PayloadTransition>& transitions, uint64_t seed) {
  RepsOptions options;
  options.returns = RepsReturns::kUnitRange;
  options.min_temperature = 0.01;
  options.seed = seed;
  constexpr int kUpdates = 40;
  const auto cost = [&](const Eigen::MatrixXd& xi) {
    VectorXd costs = VectorXd::Zero(xi.cols());
    for (const PayloadTransition& t : transitions) {
      for (Index j = 0; j < xi.cols(); ++j) {
        const Vector2d error = PayloadStep(t.state, t.effort, xi(0, j)) - t.next;
        costs(j) += error.cwiseQuotient(kPayloadNoise).squaredNorm() /
                    static_cast<double>(transitions.size());
      }
    }
    return costs;
  };
  return SearchByReps(OfXi(), cost, options, kUpdates).distribution;
}

// Weights of draws of the prior that together predict best, in energy distance.
Found AsPopulation(const std::vector<PayloadTransition>& transitions, uint64_t seed) {
  constexpr Index kCount = 200;
  Random random(seed, {kSimulators});
  const Eigen::MatrixXd xi = OfXi().Sample(kCount, random);
  std::vector<Eigen::MatrixXd> predictions;
  Eigen::MatrixXd outcomes(2, static_cast<Index>(transitions.size()));
  for (const PayloadTransition& t : transitions) {
    outcomes.col(static_cast<Index>(predictions.size())) = t.next.cwiseQuotient(kPayloadNoise);
    Eigen::MatrixXd prediction(2, kCount);
    for (Index j = 0; j < kCount; ++j)
      prediction.col(j) = PayloadStep(t.state, t.effort, xi(0, j)).cwiseQuotient(kPayloadNoise);
    predictions.push_back(std::move(prediction));
  }
  return {xi.row(0), FitPopulation(predictions, outcomes).weights, 0.05};
}

// The posterior of every transition alone, and all of them together.
Found ByConditionalMixture(const std::vector<PayloadTransition>& transitions, uint64_t seed,
                           const std::function<void(double)>& progress) {
  ConditionalMixtureOptions options;
  options.simulations = 600;
  options.rounds = 3;
  options.max_components = 8;
  options.samples = 100;
  const auto count = static_cast<Index>(transitions.size());
  Found found{VectorXd(count * options.samples), {}, 0.03};
  for (Index i = 0; i < count; ++i) {
    progress(static_cast<double>(i) / static_cast<double>(count));
    const PayloadTransition& t = transitions[static_cast<size_t>(i)];
    const auto simulate = [&](const Eigen::MatrixXd& xi, int64_t first) {
      Eigen::MatrixXd outcomes(2, xi.cols());
      for (Index j = 0; j < xi.cols(); ++j) {
        Random noise(seed,
                     {kSimulation, static_cast<uint32_t>(i), static_cast<uint32_t>(first + j)});
        outcomes.col(j) = ReadPayload(PayloadStep(t.state, t.effort, xi(0, j)), noise);
      }
      return outcomes;
    };
    const Problem problem{OfXi(), t.next, simulate};
    const Posterior posterior =
        InferConditionalMixture(problem, options, seed + static_cast<uint64_t>(i));
    found.xi.segment(i * options.samples, options.samples) = posterior.samples.row(0).transpose();
  }
  found.weights = VectorXd::Constant(found.xi.size(), 1 / static_cast<double>(found.xi.size()));
  return found;
}

struct Shown {
  std::string name, css, words;
  VectorXd density;
};

constexpr char kRules[] =
    R"(text.muted { fill: #5b6676; }
.truth { fill: none; stroke: #1b2330; stroke-width: 1.2; stroke-dasharray: 4 3; }
.line { stroke-width: 1.8; } .area { stroke: none; fill-opacity: 0.18; }
.squared.line { fill: none; stroke: #b3261e; } .squared.area { fill: #b3261e; }
.population.line { fill: none; stroke: #1f5fbf; } .population.area { fill: #1f5fbf; }
.mixture.line { fill: none; stroke: #1a7f47; } .mixture.area { fill: #1a7f47; }
)";

// A panel for each method, one above the other: their heights differ too much for one.
std::string Draw(const VectorXd& grid, const std::vector<Shown>& curves) {
  constexpr double kWidth = 640, kLeft = 70, kRight = 626, kTop = 64, kHeight = 110, kGap = 40;
  const double height = kTop + static_cast<double>(curves.size()) * (kHeight + kGap) + 4;
  Svg svg(kWidth, height,
          "densities over simulators that three methods find for a robot that is two");
  svg.Rectangle(0, 0, kWidth, height, "paper");
  const Axis x(grid(0), grid(grid.size() - 1), kLeft, kRight);
  svg.Line(kLeft, 20, kLeft + 26, 20, "truth");
  svg.Text(
      kLeft + 33, 24,
      fmt::format(
          "the robot: light, ξ = -1, in {:.0f} % of the transitions, heavy, ξ = 1, in {:.0f} %",
          100 * (1 - kHeavyShare), 100 * kHeavyShare),
      "label", Svg::Anchor::kStart);
  for (size_t i = 0; i < curves.size(); ++i) {
    const Shown& curve = curves[i];
    const double top = kTop + static_cast<double>(i) * (kHeight + kGap), bottom = top + kHeight;
    const Axis y(0, 1.1 * curve.density.maxCoeff(), bottom, top);
    const bool last = i + 1 == curves.size();
    svg.Frame(x, y, last ? "simulator ξ: payload 0.8 exp(ξ / 2) kg" : "", "density", 8, 4);
    for (const Axis::Tick& tick : x.Ticks(8)) {
      svg.Line(x.Pixel(tick.value), bottom, x.Pixel(tick.value), top, "grid");
    }
    for (const double mode : {kLightPayload, kHeavyPayload})
      svg.Line(x.Pixel(mode), bottom, x.Pixel(mode), top, "truth");
    std::vector<Vector2d> points;
    points.reserve(static_cast<size_t>(grid.size()));
    for (Index k = 0; k < grid.size(); ++k)
      points.emplace_back(x.Pixel(grid(k)), y.Pixel(curve.density(k)));
    svg.Path(points, curve.css + " line");
    points.emplace_back(kRight, bottom);
    points.emplace_back(kLeft, bottom);
    svg.Path(points, curve.css + " area", true);
    svg.Line(kLeft, top - 12, kLeft + 26, top - 12, curve.css + " line");
    svg.Text(kLeft + 33, top - 8, curve.name, "name", Svg::Anchor::kStart);
    svg.Text(kRight, top - 8, curve.words, "muted", Svg::Anchor::kEnd);
  }
  return svg.PrintAlone(kRules);
}

// A method's rows: what it found, as a density, and in numbers that all rows repeat.
Results::Rows Tabulate(const VectorXd& grid, const std::function<double(double)>& density,
                       double light, double heavy, double mean, double sd) {
  Results::Rows rows;
  for (const double x : grid) rows.push_back({x, density(x), light, heavy, mean, sd});
  return rows;
}

Results::Rows Tabulate(const VectorXd& grid, const Found& found) {
  return Tabulate(
      grid, [&](double x) { return found.Density(x); }, found.Near(kLightPayload),
      found.Near(kHeavyPayload), found.mean(), found.sd());
}

Results::Rows Tabulate(const VectorXd& grid, const Gaussian& found) {
  const double mean = found.mean(0), sd = std::sqrt(found.covariance(0, 0));
  // Drawn with a kernel, as the others are: it may be narrower than a line.
  const Found line{VectorXd::Constant(1, mean), VectorXd::Ones(1), std::hypot(sd, 0.03)};
  const auto below = [&](double x) { return NormalCdf((x - mean) / sd); };
  const auto near = [&](double mode) { return below(mode + kNear) - below(mode - kNear); };
  return Tabulate(
      grid, [&](double x) { return line.Density(x); }, near(kLightPayload), near(kHeavyPayload),
      mean, sd);
}

std::string Percent(double light, double heavy) {
  return fmt::format("{:.0f} % and {:.0f} %", 100 * light, 100 * heavy);
}

int MakeFigure(Process& process, const std::filesystem::path& output, uint64_t seed, bool quick) {
  Random random(seed, {kRobot});
  const std::vector<PayloadTransition> transitions = RecordPayloads(quick ? 20 : 400, random);
  const VectorXd grid = VectorXd::LinSpaced(321, -2, 2);
  const Ranks ranks;
  Results results(output / "figure_1.csv",
                  fmt::format("seed {}{}, {}", seed, quick ? ", quick" : "", Provenance({})),
                  {"method"}, {"xi", "density", "near_light", "near_heavy", "mean", "sd"}, ranks);
  const std::vector<Job> jobs = {
      {"squared_error", 1, 0,
       [&](const auto&) { return Tabulate(grid, BySquaredError(transitions, seed)); }},
      {"population", 1, 1,
       [&](const auto&) { return Tabulate(grid, AsPopulation(transitions, seed)); }},
      {"mixture", 100, 2, [&](const auto& progress) {
         return Tabulate(grid, ByConditionalMixture(transitions, seed, progress));
       }}};
  if (const auto status = RunJobs(process, jobs, results)) return *status;

  std::vector<Shown> curves = {{"squared error, Gaussian search", "squared", {}, grid},
                               {"energy distance, population", "population", {}, grid},
                               {"mixture, transition by transition", "mixture", {}, grid}};
  for (size_t i = 0; i < curves.size(); ++i) {
    const Results::Rows& rows = results.Of(jobs[i].key);
    curves[i].words =
        fmt::format("within {} of the two: {}", kNear, Percent(rows[0][2], rows[0][3]));
    for (Index k = 0; k < grid.size(); ++k) curves[i].density(k) = rows[static_cast<size_t>(k)][1];
  }
  WriteAtomically(output / "figure_1.svg", Draw(grid, curves));
  const auto& squared = results.Of("squared_error")[0];
  const auto percent = [&](const char* method) {
    return Percent(results.Of(method)[0][2], results.Of(method)[0][3]);
  };
  std::cout << fmt::format(
      "within {} of the light and of the heavy payload, which the robot has in {} of {} "
      "transitions: squared error {} (it is at {:.2f} ± {:.1g}), "
      "energy distance {}, mixture {}\n",
      kNear, Percent(1 - kHeavyShare, kHeavyShare), transitions.size(), percent("squared_error"),
      squared[4], squared[5], percent("population"), percent("mixture"));
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  std::string output = ".";
  uint64_t seed = 1;
  bool quick = false;
  return plumb::Run(
      "plumb-figure-1",
      "Which simulators three methods find for a robot whose payload is light or heavy.", argc,
      argv,
      [&](CLI::App& app) {
        plumb::AddOutputFlag(app, output, "figure_1.csv and figure_1.svg");
        app.add_option("--seed", seed, "of all random numbers")->capture_default_str();
        app.add_flag("--quick", quick, "a twentieth of the transitions, in a second");
        plumb::AddExamples(app, {"plumb-figure-1 --quick"});
      },
      [&](plumb::Process& process) { return plumb::MakeFigure(process, output, seed, quick); });
}
