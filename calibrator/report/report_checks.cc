#include "calibrator/report/report_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "calibrator/report/report_plots.h"
#include "plot/html.h"
#include "plot/svg.h"

namespace plumb {

std::string PredictionSection(const Holdout& holdout) {
  std::string html = "<h2>Predictions of held-out motion</h2>\n" + Paragraph(holdout.summary);
  const std::string plot = ErrorPlot(holdout.errors);
  if (plot.empty()) return html;
  html += Figure(
      plot, kPriorPosteriorKey + fmt::format("Root mean square error of predicting so many control "
                                             "steps ahead, of {} transitions that "
                                             "the fit has not seen.",
                                             holdout.held_out));
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
  return html + table.Print();
}

std::string MisfitSection(const Findings& findings) {
  const Misspecification& model = findings.misspecification;
  std::string html =
      "<h2>Can the model explain the robot?</h2>\n" +
      Paragraph(model.summary.empty() && !model.alarm ? "This was not tested." : model.summary) +
      fmt::format("<p>Mean squared whitened one-step error: {} (1 = down to the noise).</p>\n",
                  Number(findings.discrepancy, 0.01));
  if (model.misfits.empty()) return html;
  Table table({"misfit", "test", "statistic", "p, corrected", "share of the errors"});
  for (const Misfit& m : model.misfits) {
    table.Add({Escape(m.what), Escape(m.test), Number(m.statistic, NAN), Number(m.p, NAN),
               std::isfinite(m.effect) ? fmt::format("{:.0f} %", 100 * m.effect) : "\xe2\x80\x93"});
  }
  return html + table.Print();
}

std::string GapSection(const Gap& gap, const RobotDescription& robot) {
  if (gap.summary.empty()) return "";
  std::string html = "<h2>What the model lacks</h2>\n" + Paragraph(gap.summary);
  if (!gap.residual) return html;
  Table table({"joint", "steps", "error of one step", "with the residual", "of readings alone",
               "explained"});
  html += "<figure><div class=\"panels\">\n";
  for (const auto& [condition, quality] :
       {std::pair{"free", &gap.free}, {"touching", &gap.touching}}) {
    const Eigen::VectorXd explained = Explained(*quality);
    if (explained.size() == 0) continue;
    html += ErrorsLeftPlot(*quality, robot, condition);
    for (Eigen::Index i = 0; i < explained.size(); ++i) {
      const JointDescription& joint = robot.joints[static_cast<size_t>(i)];
      table.Add({Escape(joint.name), fmt::format("{} {}", quality->transitions, condition),
                 Number(quality->before(i), NAN), Number(quality->after(i), NAN),
                 Number(quality->claimed(i) > 0 ? quality->claimed(i) : NAN, NAN),
                 fmt::format("{:.0f} %", 100 * explained(i))});
    }
  }
  return html +
         "</div><figcaption>What the residual leaves of each joint's error of one control step; "
         "the "
         "mark is what the readings' noise alone would make.</figcaption></figure>\n" +
         table.Print() +
         "<p class=\"note\">Root mean square errors of the velocities, rad/s or m/s, each step "
         "predicted by a residual that was learnt from the others. Explained: of the squared "
         "errors.</p>\n";
}

std::string AgreementSection(const Agreement& agreement, const Summary& summary,
                             const RobotDescription& robot, Eigen::Index most) {
  if (agreement.logs.empty()) return "";
  Table table({"", "log", "distance", "p, corrected"});
  for (size_t k = 0; k < agreement.logs.size(); ++k) {
    const LogAgreement& log = agreement.logs[k];
    table.Add(
        {std::to_string(k + 1), Escape(log.log), Number(log.distance, 0.1), Number(log.p, NAN)});
  }
  std::string html = "<h2>Do the logs agree?</h2>\n" + Paragraph(agreement.summary) + table.Print();
  constexpr size_t kMaxLogs = 40;
  if (agreement.logs.size() > kMaxLogs) return html;
  html += "<figure><div class=\"panels\">\n";
  for (Eigen::Index i = 0; i < std::min(summary.mean.size(), most); ++i)
    html += AgreementPlot(agreement.logs, summary, robot, i);
  return html +
         "</div><figcaption>Each log alone, mean and 95 %; the band is 95 % of all logs "
         "together.</figcaption></figure>\n";
}

}  // namespace plumb
