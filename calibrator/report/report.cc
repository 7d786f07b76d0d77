#include "calibrator/report/report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "calibrator/report/pair_plot.h"
#include "calibrator/report/report_checks.h"
#include "calibrator/report/report_plots.h"
#include "calibrator/report/report_residuals.h"
#include "calibrator/results/summary.h"
#include "common/atomic_file.h"
#include "common/decompositions.h"
#include "common/process.h"
#include "plot/html.h"
#include "plot/svg.h"

namespace plumb {
namespace {

using Coordinate = ParameterDescription::Coordinate;
using Index = Eigen::Index;

constexpr Index kMaxPairs = 8;
constexpr double kInvolved = 1e-3;
constexpr double kHardly = 0.22;  // nat: the data made the sd smaller by less than a fifth

class Report {
 public:
  Report(const Findings& findings, const RobotDescription& robot, const Provenance& provenance,
         const Residuals& residuals)
      : findings_(findings),
        robot_(robot),
        provenance_(provenance),
        residuals_(residuals),
        summary_(Summarise(findings, robot)) {}

  std::string Print() const {
    return Page("Calibration of " + robot_.name,
                Headline() + Group("What was learnt", Parameters() + Pairs() + KnownAndUnknown()) +
                    Group("Does the model explain the robot?",
                          PredictionPanel(findings_.holdout) + MisfitPanel(findings_) +
                              GapPanel(findings_.gap, robot_) + ResidualPanel(residuals_) +
                              AgreementPanel(findings_.agreement, summary_, robot_, kMaxPairs)) +
                    Group("How it was found", Stages() + Reproduce()));
  }

 private:
  Index size() const { return summary_.mean.size(); }
  const ParameterDescription& parameter(Index i) const {
    return robot_.parameters[static_cast<size_t>(i)];
  }
  std::string Name(Index i) const { return Escape(parameter(i).name); }

  std::string Headline() const {
    const size_t logs = provenance_.logs.size();
    std::string html = fmt::format(
        "<h1>Calibration of {}</h1>\n<p class=\"sub\">{} parameter{} from {} transitions",
        Escape(robot_.name), size(), size() == 1 ? "" : "s", findings_.transitions);
    if (logs > 0) html += fmt::format(" of {} log{}", logs, logs == 1 ? "" : "s");
    if (!provenance_.date.empty()) html += ", " + Escape(provenance_.date);
    html += "</p>\n<div class=\"verdicts\">\n";

    const bool all_known =
        findings_.identifiability.null.empty() && !findings_.identifiability.summary.empty();
    html += Verdict(all_known ? "good" : "", "What can be known", KnownSummary() + Values());
    html += ModelVerdict(findings_.misspecification);
    if (!findings_.gap.summary.empty()) html += Verdict("", "What it lacks", findings_.gap.summary);
    const bool tried = std::any_of(findings_.holdout.errors.begin(), findings_.holdout.errors.end(),
                                   [](const HorizonError& e) { return e.windows > 0; });
    html +=
        !tried ? Verdict("", "Predictions were not tested", findings_.holdout.summary)
        : findings_.holdout.better
            ? Verdict("good", "Predicts better than the prior", findings_.holdout.summary)
            : Verdict("bad", "Does not predict better than the prior", findings_.holdout.summary);
    if (!findings_.agreement.logs.empty()) {
      html += findings_.agreement.agree
                  ? Verdict("good", "The logs agree", findings_.agreement.summary)
                  : Verdict("bad", "The logs disagree", findings_.agreement.summary);
    }
    for (const std::string& warning : findings_.warnings)
      html += Verdict("bad", "Warning", warning);
    return html + "</div>\n";
  }

  static std::string ModelVerdict(const Misspecification& model) {
    if (model.alarm) return Verdict("bad", "The model does not explain the robot", model.summary);
    if (model.summary.empty())
      return Verdict("", "The model was not tested",
                     "Whether it can explain the robot is not known.");
    if (!model.judged)
      return Verdict("", "Nobody can tell whether the model explains the robot", model.summary);
    return Verdict("good", "The model explains the robot", model.summary);
  }

  std::string KnownSummary() const {
    const Identifiability& found = findings_.identifiability;
    return found.summary.empty() ? "Identifiability was not examined." : found.summary;
  }

  // The combinations that the motion determines, in numbers, where that is a headline.
  std::string Values() const {
    constexpr size_t kMost = 4;
    const std::vector<Combination>& combinations = findings_.identifiability.combinations;
    if (combinations.size() > kMost) return "";
    std::string values;
    for (const Combination& c : combinations) {
      values += (values.empty() ? ". " : ", ") + c.name + " = " + PlusMinus(c.mean, c.sd);
    }
    return values;
  }

  // First-order: the coordinate's sd in physical units, at the mean.
  double CramerRao(Index i) const {
    if (i >= findings_.cramer_rao.size()) return NAN;
    const ParameterDescription& p = parameter(i);
    const double x = p.ToCoordinate(summary_.mean(i)), step = 1e-5;
    return findings_.cramer_rao(i) * (p.ToPhysical(x + step) - p.ToPhysical(x - step)) / (2 * step);
  }

  std::string Identifiable(Index i) const {
    std::vector<std::string> others;
    bool involved = false;
    for (Index k = 0; k < size(); ++k) {
      const bool together = std::any_of(
          findings_.identifiability.null.begin(), findings_.identifiability.null.end(),
          [&](const Eigen::VectorXd& d) {
            return d.size() == size() && std::abs(d(i)) > kInvolved && std::abs(d(k)) > kInvolved;
          });
      involved = involved || together;
      if (together && k != i) others.push_back(Name(k));
    }
    if (involved && others.empty()) return "no: the motion does not depend on it";
    constexpr size_t kMaxNames = 3;
    if (others.size() > kMaxNames)
      return fmt::format("only in combination with {} others", others.size());
    if (involved) return fmt::format("only in combination with {}", fmt::join(others, ", "));
    if (summary_.gain(i) < kHardly) return "hardly: the motion adds little to the prior";
    return "yes";
  }

  std::string Parameters() const {
    Table table({"parameter", "unit", "prior", "posterior", "95 % interval", "Cram&#233;r-Rao sd",
                 "identifiable"});
    for (Index i = 0; i < size(); ++i) {
      const double sd = summary_.sd(i);
      table.Add({Name(i), Escape(parameter(i).unit),
                 PlusMinus(summary_.prior_mean(i), summary_.prior_sd(i)),
                 "<b>" + PlusMinus(summary_.mean(i), sd) + "</b>",
                 Number(summary_.lower(i), sd) + " to " + Number(summary_.upper(i), sd),
                 Number(CramerRao(i), CramerRao(i)), Identifiable(i)});
    }
    return Panel(
        Width::kFull, "Parameters",
        "Mean \xc2\xb1 standard deviation. Cram\xc3\xa9r-Rao: the smallest sd that an unbiased "
        "estimate from these data alone can have; \xe2\x88\x9e where they do not tell the "
        "parameter on its own. A posterior may be narrower, as it knows the prior, too.",
        table.Print());
  }

  std::string Pairs() const {
    std::vector<Index> shown(static_cast<size_t>(size()));
    std::iota(shown.begin(), shown.end(), 0);
    std::string selection;
    if (size() > kMaxPairs) {
      std::stable_sort(shown.begin(), shown.end(),
                       [&](Index a, Index b) { return summary_.gain(a) > summary_.gain(b); });
      shown.resize(kMaxPairs);
      std::sort(shown.begin(), shown.end());
      selection =
          fmt::format("Of {} parameters these are the {} that the data have told most about. ",
                      size(), kMaxPairs);
    }
    return Panel(
        Width::kFull, "Prior and posterior",
        selection +
            "Ellipses: 1 and 2 sigma, one pair for each component of the posterior; dots are "
            "its samples. Where the posterior is much narrower than the prior, only its "
            "surroundings are shown, and the rule above shows where in the prior they are, "
            "and how much narrower it is. Numbers: the posterior's correlation of the "
            "coordinates.",
        PriorPosteriorKey() + Scrolling(PairPlot(findings_, summary_, robot_, shown)) +
            Paragraph(findings_.check));
  }

  std::string KnownAndUnknown() const {
    const Identifiability& found = findings_.identifiability;
    std::string html = Paragraph(KnownSummary());
    if (!found.combinations.empty()) {
      Table table({"what the motion determines", "value"});
      for (const Combination& c : found.combinations)
        table.Add({Escape(c.name), PlusMinus(c.mean, c.sd)});
      html += table.Print();
    }
    if (!found.null.empty()) {
      Table table({"direction", "what changes nothing, in the parameters' coordinates"});
      for (size_t k = 0; k < found.null.size(); ++k)
        table.Add({std::to_string(k + 1), Direction(found.null[k])});
      html += table.Print();
    }
    html += Paragraph(findings_.advice);
    const std::string scree = ScreePlot(InformationEigenvalues());
    const Width width = scree.empty() ? Width::kFull : Width::kHalf;
    html = Panel(width, "What can be known from this motion",
                 "The parameters, or combinations of them, that the motion tells apart.", html);
    if (scree.empty()) return html;
    return html +
           Panel(
               width, "How much the motion tells",
               "Eigenvalues of the Fisher information in units of the prior, greatest first. Along "
               "a direction with 1 (dashed) the data tell as much as the prior; what is below the "
               "dotted line, a millionth of the greatest or 0.01, cannot be known from them.",
               scree);
  }

  std::string Direction(const Eigen::VectorXd& direction) const {
    std::string parts;
    for (Index i = 0; i < std::min(size(), direction.size()); ++i) {
      if (!(std::abs(direction(i)) > kInvolved)) continue;
      const bool log = parameter(i).coordinate == Coordinate::kLog;
      parts += (parts.empty() ? "" : ", ") + Name(i) +
               fmt::format(" {:+.3g}{}", direction(i), log ? " %" : "");
    }
    return parts;
  }

  std::vector<double> InformationEigenvalues() const {
    const Eigen::MatrixXd& information = findings_.identifiability.information;
    if (information.rows() != size() || information.cols() != size() || !information.allFinite())
      return {};
    const Eigen::VectorXd sd = findings_.prior.covariance.diagonal().cwiseSqrt();
    const Eigen::MatrixXd scaled = sd.asDiagonal() * information * sd.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled, Eigen::EigenvaluesOnly);
    std::vector<double> values(eigen.eigenvalues().begin(), eigen.eigenvalues().end());
    std::reverse(values.begin(), values.end());
    return values;
  }

  std::string Stages() const {
    if (findings_.stages.empty()) return "";
    Table table(
        {"stage", "steps per window", "windows", "simulated steps", "mean squared whitened error"});
    for (size_t k = 0; k < findings_.stages.size(); ++k) {
      const CurriculumStage& s = findings_.stages[k];
      table.Add({std::to_string(k + 1), std::to_string(s.horizon), std::to_string(s.windows),
                 std::to_string(s.simulated_steps), Number(s.discrepancy, 0.001)});
    }
    return Panel(Width::kFull, "Stages of the fit",
                 "So many steps are predicted as one window; the fit begins with the shortest.",
                 table.Print());
  }

  std::string Reproduce() const {
    Table table({"", ""});
    const auto add = [&](const std::string& what, const std::string& value) {
      table.Add({what, Escape(value)});
    };
    add("seed", std::to_string(findings_.seed));
    add("method", findings_.used == findings_.method || findings_.used.empty()
                      ? findings_.method
                      : findings_.method + ": " + findings_.used);
    for (const auto& [name, value] : provenance_.options) table.Add({Escape(name), Escape(value)});
    for (const std::string& log : provenance_.logs) add("log", log);
    add("robot's files", fmt::format("{}, fingerprint {:#018x}", robot_.file, robot_.fingerprint));
    add("version", VersionLine("plumb"));
    add("simulated steps",
        fmt::format("{} for the fit, {} for diagnostics; {} simulations failed",
                    findings_.simulated_steps, findings_.diagnostic_steps, findings_.failures));
    add("wall time", fmt::format("{:.1f} s", findings_.seconds));
    return Panel(
        Width::kFull, "How to do it again", "The same files and the same seed give the same bits.",
        (provenance_.command.empty() ? "" : "<pre>" + Escape(provenance_.command) + "</pre>\n") +
            table.Print());
  }

  const Findings& findings_;
  const RobotDescription& robot_;
  const Provenance& provenance_;
  const Residuals& residuals_;
  Summary summary_;
};

}  // namespace

std::string ReportHtml(const Findings& findings, const RobotDescription& robot,
                       const Provenance& provenance, const Residuals& residuals) {
  return Report(findings, robot, provenance, residuals).Print();
}

void WriteReport(const std::filesystem::path& file, const Findings& findings,
                 const RobotDescription& robot, const Provenance& provenance,
                 const Residuals& residuals) {
  WriteAtomically(file, ReportHtml(findings, robot, provenance, residuals));
}

}  // namespace plumb
