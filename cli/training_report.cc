#include "cli/training_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <stdexcept>

#include "common/process.h"
#include "plot/html.h"
#include "plot/svg.h"

namespace plumb {
namespace {

using Points = std::vector<Eigen::Vector2d>;

constexpr double kPlotWidth = 450, kPlotHeight = 260;
constexpr int kDraws = 2000;  // of the distribution, for means and standard deviations
constexpr uint64_t kDrawSeed = 1;

/// Of the updates, against simulated steps. A bound is drawn across.
std::string Plot(const std::string& title, const std::vector<TrainingRow>& rows,
                 double TrainingRow::*value, double bound = NAN,
                 double TrainingRow::*marks = nullptr) {
  double low = std::isfinite(bound) ? bound : std::numeric_limits<double>::infinity(),
         high = std::isfinite(bound) ? bound : -low;
  for (const TrainingRow& row : rows) {
    for (const double y : {row.*value, marks ? row.*marks : NAN}) {
      if (std::isfinite(y)) low = std::min(low, y), high = std::max(high, y);
    }
  }
  if (!(low <= high)) return "";
  const double margin = high > low ? 0.05 * (high - low) : std::max(1e-6, 0.05 * std::abs(high));
  Svg svg(kPlotWidth, kPlotHeight, title);
  const Axis x(0, rows.back().steps, 72, kPlotWidth - 12), y(low - margin, high + margin, 214, 12);
  svg.Frame(x, y, "simulated steps", title, 5, 6);
  svg.BeginClip(x.from(), y.to(), x.to() - x.from(), y.from() - y.to());
  if (std::isfinite(bound)) svg.Line(x.from(), y.Pixel(bound), x.to(), y.Pixel(bound), "limit");
  Points line;
  for (const TrainingRow& row : rows) line.emplace_back(x.Pixel(row.steps), y.Pixel(row.*value));
  svg.Path(line, "simulation line");
  for (const TrainingRow& row : rows) {
    if (marks && std::isfinite(row.*marks))
      svg.Circle(x.Pixel(row.steps), y.Pixel(row.*marks), 3, "posterior mark");
  }
  svg.EndClip();
  return svg.Print();
}

std::string Returns(const Evaluation& evaluation) {
  return fmt::format("mean {:.1f}, a tenth is below {:.1f}, worst {:.1f}, of {} simulators{}",
                     evaluation.mean, evaluation.tenth, evaluation.worst, evaluation.episodes,
                     evaluation.failed > 0 ? fmt::format("; {} failed", evaluation.failed) : "");
}

std::string Verdicts(const TrainingOutcome& outcome, const std::vector<TrainingRow>& rows) {
  const bool prior = outcome.distribution == "prior";
  std::string html = "<div class=\"verdicts\">\n";
  html += Verdict("good", "Return without exploration, on " + outcome.distribution,
                  Returns(outcome.own));
  if (!prior) html += Verdict("", "The same on the prior", Returns(outcome.on_prior));
  html += Verdict("", fmt::format("The policy of update {}", outcome.from),
                  outcome.chosen
                      ? fmt::format("It returned most of those judged along the way, in simulators "
                                    "that are the same for all of them; {} updates were made.",
                                    outcome.updates)
                      : "The last one, as the paper has it.");
  const auto skipped = std::count_if(rows.begin(), rows.end(),
                                     [](const TrainingRow& row) { return row.accepted == 0; });
  double dropped = 0;
  for (const TrainingRow& row : rows) dropped += row.dropped_episodes;
  html += Verdict(skipped + dropped > 0 ? "bad" : "good", "Updates and episodes",
                  fmt::format("{} of {} updates were skipped, {} episodes dropped as they were not "
                              "finite",
                              skipped, rows.size(), dropped));
  return html + "</div>\n";
}

std::string Curves(const RobotDescription& robot, const std::vector<TrainingRow>& rows) {
  if (rows.empty()) {
    return Panel(
        Width::kFull, "Curves", "What each update has done.",
        Paragraph("There are no curves: the table of the updates was not kept while they were "
                  "made. --report or --csv, given from the beginning, keeps it."));
  }
  struct {
    std::string title, what, drawing;
  } const curves[] = {
      {"Return",
       "Mean return of each batch's episodes, with exploration. Dots: without (--evaluate-every).",
       Plot("return", rows, &TrainingRow::mean_return, NAN, &TrainingRow::evaluation_return)},
      {"Step",
       "Divergence of the policy before from the one after an update; dotted: the bound, kl of "
       "[training].",
       Plot("KL [nat]", rows, &TrainingRow::kl, robot.training.kl)},
      {"Gain", "What the update is expected to gain, in standard deviations of the advantage.",
       Plot("gain", rows, &TrainingRow::surrogate_gain)},
      {"Critic",
       "Share of the returns' variance that it explains, before it has seen them. Dotted: all of "
       "it.",
       Plot("explained", rows, &TrainingRow::explained_variance, 1)},
      {"Exploration", "Entropy of the policy: how much it still tries.",
       Plot("entropy [nat]", rows, &TrainingRow::entropy)},
  };
  std::string panels;
  for (const auto& [title, what, drawing] : curves) {
    if (!drawing.empty()) panels += Panel(Width::kHalf, title, what, drawing);
  }
  return panels;
}

std::string Simulators(const RobotDescription& robot, const ParameterDistribution& distribution) {
  if (robot.parameters.empty()) return "";
  const auto count = static_cast<Eigen::Index>(robot.parameters.size());
  Eigen::MatrixXd draws(count, kDraws);
  Random random(kDrawSeed, {0});
  for (Eigen::Index i = 0; i < kDraws; ++i) draws.col(i) = distribution.Sample(random);
  Table table({"parameter", "unit", "trained on"});
  for (Eigen::Index i = 0; i < count; ++i) {
    const double mean = draws.row(i).mean(),
                 sd = std::sqrt((draws.row(i).array() - mean).square().mean());
    const ParameterDescription& parameter = robot.parameters[static_cast<size_t>(i)];
    table.Add({Escape(parameter.name), Escape(parameter.unit), PlusMinus(mean, sd)});
  }
  return Panel(
      Width::kFull, "Simulators",
      distribution.residual
          ? fmt::format("{:.0f} % of the episodes are simulated with the residual that was "
                        "learnt of what the model lacks.",
                        100 * (1 - ParameterDistribution::kPlainShare))
          : "No residual: the model as it is.",
      table.Print());
}

std::string Reproduce(const RobotDescription& robot, const TrainingOutcome& outcome) {
  const TrainingSettings& s = robot.training;
  Table table({"", ""});
  const auto add = [&](const std::string& what, const std::string& value) {
    table.Add({Escape(what), Escape(value)});
  };
  add("seed", std::to_string(outcome.seed));
  add("steps per update", std::to_string(s.batch));
  add("gamma, lambda", fmt::format("{}, {}", s.gamma, s.lambda));
  add("KL bound, damping, CG iterations",
      fmt::format("{}, {}, {}", s.kl, s.damping, s.cg_iterations));
  add("hidden layers", fmt::format("{}", fmt::join(s.hidden, ", ")));
  add("simulated steps", std::to_string(outcome.steps));
  add("wall time", fmt::format("{:.1f} s", outcome.seconds));
  add("robot's files", fmt::format("{}, fingerprint {:#018x}", robot.file, robot.fingerprint));
  add("version", VersionLine("plumb"));
  return Panel(Width::kFull, "How to do it again",
               "The same files and the same seed give the same bits.",
               "<pre>" + Escape(outcome.command) + "</pre>\n" + table.Print());
}

}  // namespace

std::vector<TrainingRow> ReadTrainingRows(const std::string& file) {
  std::ifstream stream(file);
  if (!stream) throw std::runtime_error(file + ": cannot be opened");
  std::vector<TrainingRow> rows;
  std::string line;
  std::getline(stream, line);  // the header
  for (int number = 2; std::getline(stream, line); ++number) {
    TrainingRow row;
    double* const fields[] = {&row.update,
                              &row.steps,
                              &row.mean_return,
                              &row.evaluation_return,
                              &row.kl,
                              &row.surrogate_gain,
                              &row.explained_variance,
                              &row.entropy,
                              &row.accepted,
                              &row.dropped_episodes,
                              &row.seconds};
    const char* at = line.c_str();
    for (double* field : fields) {
      char* end = nullptr;
      *field = std::strtod(at, &end);
      if (end == at || (*end != ',' && *end != '\0'))
        throw std::runtime_error(
            fmt::format("{}:{}: is no line of a training's table", file, number));
      at = *end == ',' ? end + 1 : end;
    }
    rows.push_back(row);
  }
  return rows;
}

std::string TrainingReport(const RobotDescription& robot, const ParameterDistribution& distribution,
                           const TrainingOutcome& outcome, const std::vector<TrainingRow>& rows) {
  const std::string title = "Training of " + robot.name;
  return Page(
      title,
      "<h1>" + Escape(title) + "</h1>\n<p class=\"sub\">" +
          Escape(fmt::format("task {}, {} updates, {} simulated steps", robot.task.name,
                             outcome.updates, outcome.steps)) +
          "</p>\n" + Verdicts(outcome, rows) + Group("Updates", Curves(robot, rows)) +
          Group("How it was trained", Simulators(robot, distribution) + Reproduce(robot, outcome)));
}

}  // namespace plumb
