// What a run has come to, for programs.
#include <cmath>

#include "cli/progress.h"

namespace plumb {

double Progress::TrueCombination(const calibration_status_t& c, size_t index,
                                 const Eigen::VectorXd& truth) const {
  double sum = 0, alone = 0;
  bool log = true;
  int involved = 0;
  for (size_t i = 0; i < c.mean.size(); ++i) {
    const double power = c.combination_power[index * c.mean.size() + i];
    if (power == 0) continue;
    ++involved;
    alone = power == 1 ? truth(static_cast<Eigen::Index>(i)) : NAN;
    sum += power * robot_.parameters[i].ToCoordinate(truth(static_cast<Eigen::Index>(i)));
    log = log && robot_.parameters[i].coordinate == ParameterDescription::Coordinate::kLog;
  }
  if (log) return std::exp(sum);
  // as calibrator/diagnostics/identifiability.h has it
  return involved == 1 && std::isfinite(alone) ? alone : sum;
}

nlohmann::json Progress::Summarise(const Iteration& iteration, const Eigen::VectorXd& truth) const {
  using nlohmann::json;
  const calibration_status_t& c = iteration.calibration;
  json combinations = json::array();
  for (size_t i = 0; i < c.combination.size(); ++i) {
    combinations.push_back(
        {{"name", c.combination[i]},
         {"mean", c.combination_mean[i]},
         {"sd", c.combination_sd[i]},
         {"hidden", truth.size() > 0 ? json(TrueCombination(c, i, truth)) : json()}});
  }
  return {{"iteration", c.iteration},
          {"alarm", c.alarm},
          {"gap", c.gap},
          {"mean", c.mean},
          {"sd", c.sd},
          {"combinations", combinations},
          {"discrepancy", c.discrepancy},
          {"prior_discrepancy", c.prior_discrepancy},
          {"horizons", c.horizon},
          {"error", c.error_before},
          {"error_after", c.error_after},
          {"error_prior", c.error_prior},
          {"kl", c.kl},
          {"ess", c.ess},
          {"transitions", c.transitions},
          {"simulated_return", iteration.simulated_return},
          {"robot_return", iteration.robot_return},
          {"seconds", iteration.seconds}};
}

nlohmann::json Progress::SummariseDecisions() const {
  nlohmann::json decisions = nlohmann::json::array();
  for (const auto& [challenger, decision] : decisions_) {
    decisions.push_back({{"policy", challenger},
                         {"accepted", decision.accepted},
                         {"probability", decision.probability},
                         {"return", decision.challenger_return},
                         {"incumbent_return", decision.incumbent_return},
                         {"summary", decision.text}});
  }
  return decisions;
}

nlohmann::json Progress::Summary(const Eigen::VectorXd& truth) const {
  using nlohmann::json;
  json summary;
  std::vector<std::string> names;
  for (const ParameterDescription& p : robot_.parameters) names.push_back(p.name);
  summary["robot"] = robot_.name;
  summary["parameters"] = names;
  summary["hidden"] =
      truth.size() > 0 ? json(std::vector<double>(truth.begin(), truth.end())) : json();
  summary["iterations"] = json::array();
  for (const Iteration& iteration : done_)
    summary["iterations"].push_back(Summarise(iteration, truth));
  if (!done_.empty()) summary["identifiability"] = done_.back().calibration.identifiability;
  if (training_.incumbent >= 0) {
    summary["policy"] = {
        {"iteration", training_.incumbent}, {"since", training_.incumbent_since}, {"why", Why()}};
  } else {
    summary["policy"] = nullptr;
  }
  summary["decisions"] = SummariseDecisions();
  summary["evaluation_returns"] = evaluation_;
  summary["dropped_episodes"] = training_.dropped_episodes;
  summary["seconds"] = {{"robot", spent_.robot},
                        {"training", spent_.training},
                        {"other", spent_.other},
                        {"total", spent_.accounted}};
  return summary;
}

}  // namespace plumb
