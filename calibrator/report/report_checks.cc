#include "calibrator/report/report_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "calibrator/report/report_plots.h"
#include "plot/html.h"
#include "plot/svg.h"
#include "robot/coordinate_names.h"

namespace plumb {

std::string PredictionPanel(const Holdout& holdout) {
  const std::string title = "Predictions of held-out motion", plot = ErrorPlot(holdout.errors);
  if (plot.empty())
    return Panel(Width::kHalf, title,
                 "How far the model's predictions of motion are off that the fit has not seen.",
                 Paragraph(holdout.summary));
  const bool corrected =
      std::any_of(holdout.errors.begin(), holdout.errors.end(),
                  [](const HorizonError& e) { return std::isfinite(e.corrected); });
  std::vector<std::string> head{"steps ahead", "windows", "posterior", "prior", "ratio"};
  if (corrected) head.emplace_back("posterior with residual");
  Table table(head);
  for (const HorizonError& e : holdout.errors) {
    std::vector<std::string> row{std::to_string(e.horizon), std::to_string(e.windows),
                                 Number(e.posterior, NAN), Number(e.prior, NAN),
                                 Number(e.posterior / e.prior, 0.01)};
    if (corrected) row.push_back(Number(e.corrected, NAN));
    table.Add(row);
  }
  return Panel(
      Width::kHalf, title,
      fmt::format("Root mean square error of predicting so many control steps ahead, of {} "
                  "transitions that the fit has not seen.",
                  holdout.held_out),
      Paragraph(holdout.summary) + PriorPosteriorKey() + plot + table.Print());
}

std::string MisfitPanel(const Findings& findings) {
  const Misspecification& model = findings.misspecification;
  const std::string title = "What the alarm says",
                    what = std::isnan(findings.discrepancy)
                               ? "The noise is estimated from the errors themselves."
                               : fmt::format(
                                     "Mean squared whitened one-step error: {} (1 = down to the "
                                     "noise).",
                                     Number(findings.discrepancy, 0.01)),
                    summary =
                        Paragraph(model.summary.empty() && !model.alarm ? "This was not tested."
                                                                        : model.summary);
  if (model.misfits.empty()) return Panel(Width::kHalf, title, what, summary);
  Table table({"misfit", "test", "statistic", "p, corrected", "share of the errors"});
  for (const Misfit& m : model.misfits) {
    table.Add({Escape(m.what), Escape(m.test), Number(m.statistic, NAN), Number(m.p, NAN),
               std::isfinite(m.effect) ? fmt::format("{:.0f} %", 100 * m.effect) : "\xe2\x80\x93"});
  }
  return Panel(Width::kHalf, title, what, summary + table.Print());
}

std::string GapPanel(const Gap& gap, const RobotDescription& robot) {
  if (gap.summary.empty()) return "";
  const std::string title = "What the model lacks";
  if (!gap.residual) {
    return Panel(Width::kFull, title,
                 "Where the alarm speaks, what the simulator lacks is learnt from the same motion.",
                 Paragraph(gap.summary));
  }
  Table table({"joint", "steps", "error of one step", "with the residual", "of readings alone",
               "explained"});
  std::string drawings;
  const std::vector<std::string> names = CoordinateNames(robot).v;
  for (const auto& [condition, quality] :
       {std::pair{"free", &gap.free}, {"touching", &gap.touching}}) {
    const Eigen::VectorXd explained = Explained(*quality);
    if (explained.size() == 0) continue;
    drawings += ErrorsLeftPlot(*quality, robot, condition);
    for (Eigen::Index i = 0; i < explained.size(); ++i) {
      table.Add({Escape(names[static_cast<size_t>(i)]),
                 fmt::format("{} {}", quality->transitions, condition),
                 Number(quality->before(i), NAN), Number(quality->after(i), NAN),
                 Number(quality->claimed(i) > 0 ? quality->claimed(i) : NAN, NAN),
                 fmt::format("{:.0f} %", 100 * explained(i))});
    }
  }
  return Panel(
      Width::kFull, title,
      "What the residual leaves of each joint's error of one control step; the mark is what "
      "the readings' noise alone would make. Root mean square errors of the velocities, rad/s "
      "or m/s, each step predicted by a residual that was learnt from the others. Explained: "
      "of the squared errors.",
      Paragraph(gap.summary) + Row(drawings) + table.Print());
}

std::string AgreementPanel(const Agreement& agreement, const Summary& summary,
                           const RobotDescription& robot, Eigen::Index most) {
  if (agreement.logs.empty()) return "";
  Table table({"", "log", "distance", "p, corrected"});
  for (size_t k = 0; k < agreement.logs.size(); ++k) {
    const LogAgreement& log = agreement.logs[k];
    table.Add(
        {std::to_string(k + 1), Escape(log.log), Number(log.distance, 0.1), Number(log.p, NAN)});
  }
  std::string drawings;
  constexpr size_t kMaxLogs = 40;
  for (Eigen::Index i = 0; i < std::min(summary.mean.size(), most); ++i) {
    if (agreement.logs.size() <= kMaxLogs)
      drawings += AgreementPlot(agreement.logs, summary, robot, i);
  }
  return Panel(Width::kFull, "Do the logs agree?",
               "Each log alone, mean and 95 %; the band is 95 % of all logs together.",
               Paragraph(agreement.summary) + table.Print() + Row(drawings));
}

}  // namespace plumb
