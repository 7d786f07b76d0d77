#include "cli/launch_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "calibrator/diagnostics/holdout.h"
#include "calibrator/report/report_plots.h"
#include "cli/run_plots.h"
#include "common/median.h"
#include "common/special_numbers.h"
#include "plot/html.h"
#include "plot/svg.h"

namespace plumb {
namespace {

using nlohmann::json;

double Real(const json& value) { return value.is_number() ? value.get<double>() : kNaN; }

std::vector<double> Reals(const json& values) {
  std::vector<double> reals;
  for (const json& value : values) reals.push_back(Real(value));
  return reals;
}

std::string Return(double value) {
  return std::isfinite(value) ? fmt::format("{:.0f}", value) : "\xe2\x80\x93";
}

std::string Digits(double value) {
  return std::isfinite(value) ? fmt::format("{:.3g}", value) : "\xe2\x80\x93";
}

class LaunchPage {
 public:
  LaunchPage(const RobotDescription& robot, const json& summary, const std::string& command)
      : robot_(robot),
        summary_(summary),
        command_(command),
        iterations_(summary.at("iterations")) {}

  std::string Print() const {
    const std::string title = "Run of " + robot_.name;
    return Page(
        title,
        "<h1>" + Escape(title) + "</h1>\n<p class=\"sub\">" + Escape(Subtitle()) + "</p>\n" +
            Verdicts() + (policy().is_null() ? "" : Group("Policies", PolicyPanel())) +
            (iterations_.empty() ? ""
                                 : Group("Learning", ParameterPanel() + KnownPanel() +
                                                         PredictionPanel() + IterationPanel())) +
            Group("How it was found", Reproduce()));
  }

 private:
  std::string Text(const char* field) const { return summary_.at(field).get<std::string>(); }
  const json& policy() const { return summary_.at("policy"); }

  std::string Subtitle() const {
    return fmt::format("{} iterations on {}, in {} time, seed {}", iterations_.size(), Text("bus"),
                       Text("time"), summary_.at("seed").get<uint64_t>());
  }

  std::string Verdicts() const {
    std::string html = "<div class=\"verdicts\">\n";
    if (!policy().is_null()) {
      html +=
          Verdict("good",
                  fmt::format("Policy {} runs since iteration {}",
                              policy().at("iteration").get<int>(), policy().at("since").get<int>()),
                  policy().at("why").get<std::string>());
    }
    const std::vector<double> returns = Reals(summary_.at("evaluation_returns"));
    if (!returns.empty()) {
      html +=
          Verdict("", "What it returns on the robot",
                  fmt::format("Mean {:.0f}, median {:.0f}, worst {:.0f} of {} roll-outs.",
                              std::accumulate(returns.begin(), returns.end(), 0.0) /
                                  static_cast<double>(returns.size()),
                              Median(returns), *std::ranges::min_element(returns), returns.size()));
    }
    if (!iterations_.empty()) {
      const auto alarm = iterations_.back().at("alarm").get<std::string>(),
                 gap = iterations_.back().at("gap").get<std::string>();
      html += !alarm.empty() ? Verdict("bad", "The model does not explain the robot", alarm)
              : gap.empty()  ? Verdict("good", "The model explains the robot",
                                       "The alarm does not speak of the last iteration's motion.")
                            : Verdict("", "Whether the model explains the robot is not known", gap);
      if (!alarm.empty() && !gap.empty()) html += Verdict("", "What it lacks", gap);
      html += Verdict("", "What can be known", Text("identifiability"));
    }
    const auto dropped = summary_.at("dropped_episodes").get<int64_t>();
    const int rearms = summary_.at("rearms").get<int>();
    if (dropped > 0)
      html += Verdict("bad", fmt::format("{} episodes of training were dropped", dropped),
                      "Their simulation did not stay finite.");
    if (rearms > 0)
      html += Verdict("bad", fmt::format("The robot was armed {} times after a fault", rearms),
                      "The driver's log says which.");
    return html + "</div>\n";
  }

  PolicyReturns Returns() const {
    PolicyReturns returns;
    returns.last = policy().at("iteration").get<int>();  // where no iteration tells
    for (const json& iteration : iterations_) {
      returns.last = iteration.at("iteration").get<int>();
      returns.simulated[returns.last - 1] = Real(iteration.at("simulated_return"));
      returns.robot[returns.last - 1] = Real(iteration.at("robot_return"));
    }
    returns.in_the_end = Reals(summary_.at("evaluation_returns"));
    const json& decisions = summary_.at("decisions");
    for (const json& decision : decisions) {
      const bool accepted = decision.at("accepted").get<bool>();
      returns.incumbent[decision.at("policy").get<int>()] =
          Real(decision.at(accepted ? "return" : "incumbent_return"));
    }
    return returns;
  }

  std::string PolicyPanel() const {
    std::string html = ReturnsPlot(Returns());
    if (!html.empty()) {
      html = Key({{"robot", "on the robot"},
                  {"simulation", "in simulators that it was trained for"},
                  {"reference", "the policy that the robot was run with"}}) +
             html;
    }
    Table table({"policy", "accepted", "better with", "return", "of the one before", ""});
    for (const json& decision : summary_.at("decisions")) {
      const bool first = decision == summary_.at("decisions").front();  // better than nobody
      const double probability = first ? NAN : Real(decision.at("probability"));
      table.Add({std::to_string(decision.at("policy").get<int>()),
                 decision.at("accepted").get<bool>() ? "yes" : "no",
                 std::isfinite(probability) ? fmt::format("{:.0f} %", 100 * probability)
                                            : Digits(probability),
                 Return(Real(decision.at("return"))), Return(Real(decision.at("incumbent_return"))),
                 Escape(decision.at("summary").get<std::string>())});
    }
    return Panel(
        Width::kFull, "Return: robot and simulation",
        "What each policy earns in an episode; small dots: roll-outs of the one that runs in "
        "the end. Below: which were accepted, and why.",
        html + table.Print());
  }

  std::string ParameterPanel() const {
    const std::vector<double> hidden = Reals(summary_.at("hidden"));
    std::string drawings;
    Table table({"parameter", "unit", "prior", "learnt", "hidden", "error"});
    for (size_t i = 0; i < robot_.parameters.size(); ++i) {
      const ParameterDescription& p = robot_.parameters[i];
      std::vector<Learnt> learnt;
      for (const json& iteration : iterations_) {
        learnt.push_back({iteration.at("iteration").get<int>(), Real(iteration.at("mean").at(i)),
                          Real(iteration.at("sd").at(i))});
      }
      const Learnt& last = learnt.back();
      const double truth = i < hidden.size() ? hidden[i] : NAN, error = last.mean / truth - 1;
      drawings += LearnedPlot(p, learnt, truth);
      table.Add({Escape(p.name), Escape(p.unit), PlusMinus(p.mean, std::sqrt(p.variance)),
                 PlusMinus(last.mean, last.sd), Number(truth, last.sd),
                 std::isfinite(error) ? fmt::format("{:.2f} %", 100 * error) : Digits(error)});
    }
    return Panel(
        Width::kFull, "Parameters",
        "Mean and 95 % after each iteration; iteration 0 is the prior, which goes out of the "
        "picture where it is much wider. Black: hidden truth, where there is one.",
        Row(drawings) + table.Print());
  }

  std::string KnownPanel() const {
    const json& combinations = iterations_.back().at("combinations");
    if (combinations.size() >= robot_.parameters.size())
      return "";  // as the parameters' table has it
    Table known({"what the motion determines", "learnt", "hidden"});
    for (const json& c : combinations) {
      const double c_sd = Real(c.at("sd"));
      known.Add({Escape(c.at("name").get<std::string>()), PlusMinus(Real(c.at("mean")), c_sd),
                 Number(Real(c.at("hidden")), c_sd)});
    }
    return Panel(Width::kHalf, "What the motion determines",
                 "Combinations of parameters that it tells apart, where it does not tell each.",
                 known.Print());
  }

  std::string PredictionPanel() const {
    const json& last = iterations_.back();
    const std::vector<double> before = Reals(last.at("error_prior")),
                              after = Reals(last.at("error_after"));
    std::vector<HorizonError> errors;
    for (size_t k = 0; k < std::min(before.size(), after.size()); ++k) {
      HorizonError error{};
      error.horizon = last.at("horizons").at(k).get<int>();
      error.prior = before[k], error.posterior = after[k];
      errors.push_back(error);
    }
    const std::string drawing = ErrorPlot(errors);
    if (drawing.empty()) return "";
    return Panel(Width::kHalf, "Error after n steps",
                 "Of predicting the newest roll-out so many steps ahead.",
                 PriorPosteriorKey() + drawing);
  }

  std::string IterationPanel() const {
    std::vector<std::string> header{"iteration", "transitions", "discrepancy"};
    for (const json& horizon : iterations_.back().at("horizons"))
      header.push_back(fmt::format("{}-step", horizon.get<int>()));
    for (const char* what : {"KL [nat]", "ESS", "return sim", "robot", "s", ""})
      header.emplace_back(what);
    Table table(header);
    for (const json& iteration : iterations_) {
      std::vector<std::string> cells{std::to_string(iteration.at("iteration").get<int>()),
                                     std::to_string(iteration.at("transitions").get<int64_t>()),
                                     Digits(Real(iteration.at("discrepancy")))};
      for (const double error : Reals(iteration.at("error"))) cells.push_back(Digits(error));
      for (const char* number : {"kl", "ess"}) cells.push_back(Digits(Real(iteration.at(number))));
      for (const char* number : {"simulated_return", "robot_return"})
        cells.push_back(Return(Real(iteration.at(number))));
      cells.push_back(Digits(Real(iteration.at("seconds"))));
      cells.push_back(Escape(iteration.at("gap").get<std::string>()));
      table.Add(cells);
    }
    return Panel(
        Width::kFull, "Iterations",
        "Discrepancy: mean squared error of one step in units of its uncertainty. Errors of "
        "several steps: of the newest roll-out, before it was learnt from, in standard units.",
        table.Print());
  }

  std::string Reproduce() const {
    const json& seconds = summary_.at("seconds");
    Table table({"", ""});
    const auto add = [&](const std::string& what, const std::string& value) {
      table.Add({Escape(what), Escape(value)});
    };
    add("seed", std::to_string(summary_.at("seed").get<uint64_t>()));
    add("time by the run's clock",
        fmt::format("{:.0f} s: {:.0f} s on the robot, {:.0f} s training, {:.0f} s for the rest",
                    Real(seconds.at("total")), Real(seconds.at("robot")),
                    Real(seconds.at("training")), Real(seconds.at("other"))));
    add("robot's files", fmt::format("{}, fingerprint {:#018x}", robot_.file, robot_.fingerprint));
    add("version", Text("version"));
    return Panel(Width::kFull, "How to do it again",
                 "The same files and the same seed give the same bits, in virtual time.",
                 "<pre>" + Escape(command_) + "</pre>\n" + table.Print());
  }

  const RobotDescription& robot_;
  const json& summary_;
  const std::string& command_;
  const json& iterations_;
};

}  // namespace

std::string LaunchReport(const RobotDescription& robot, const json& summary,
                         const std::string& command) {
  return LaunchPage(robot, summary, command).Print();
}

std::string LaunchReportBegins() { return kPageBegins; }

}  // namespace plumb
