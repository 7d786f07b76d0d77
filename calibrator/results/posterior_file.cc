#include "calibrator/results/posterior_file.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "calibrator/results/json_lines.h"
#include "calibrator/results/summary.h"
#include "common/atomic_file.h"
#include "common/outside_text.h"
#include "common/process.h"
#include "robot/physics_fingerprint.h"
#include "robot/posterior_format.h"
#include "robot/residual_json.h"

namespace plumb {
namespace {

using json = nlohmann::ordered_json;

constexpr Eigen::Index kMaxSamples = 1000;

json ToJson(const Eigen::VectorXd& x) { return std::vector<double>(x.begin(), x.end()); }

json ToJson(const Eigen::MatrixXd& matrix) {
  json rows = json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    rows.push_back(ToJson(Eigen::VectorXd(matrix.row(i))));
  return rows;
}

template <class Item, class Function>
json List(const std::vector<Item>& items, const Function& to_json) {
  json list = json::array();
  for (const Item& item : items) list.push_back(to_json(item));
  return list;
}

json ToJson(const ParameterDescription& p) {
  json coordinate{{"kind", CoordinateName(p.coordinate)}};
  if (p.coordinate == ParameterDescription::Coordinate::kLogit)
    coordinate["lower"] = p.lower, coordinate["upper"] = p.upper;
  return coordinate;
}

json ToJson(const GaussianMixture& mixture) {
  return {{"weights", mixture.weights},
          {"means", List(mixture.components, [](const Gaussian& g) { return ToJson(g.mean); })},
          {"covariances",
           List(mixture.components, [](const Gaussian& g) { return ToJson(g.covariance); })}};
}

// One sample per row, evenly chosen where there are too many.
json Samples(const Eigen::MatrixXd& samples) {
  const Eigen::Index count = std::min(samples.cols(), kMaxSamples);
  json rows = json::array();
  for (Eigen::Index i = 0; i < count; ++i)
    rows.push_back(ToJson(Eigen::VectorXd(samples.col(i * samples.cols() / count))));
  return rows;
}

json ToJson(const Misspecification& found) {
  return {{"raised", found.alarm},
          {"words", found.summary},
          {"misfits", List(found.misfits, [](const Misfit& m) {
             return json{{"what", m.what},           {"joint", m.joint},
                         {"condition", m.condition}, {"test", m.test},
                         {"statistic", m.statistic}, {"p", m.p},
                         {"effect", m.effect}};
           })}};
}

// One-step errors of each velocity in a condition, in its unit.
json ToJson(const ResidualQuality& quality) {
  if (quality.before.size() == 0) return nullptr;
  return {{"transitions", quality.transitions},
          {"before", ToJson(quality.before)},
          {"after", ToJson(quality.after)},
          {"claimed", ToJson(quality.claimed)},
          {"explained", ToJson(Explained(quality))}};
}

json ToJson(const Gap& gap) {
  return {{"words", gap.summary},
          {"informed", Name(gap.informed)},
          {"free", ToJson(gap.free)},
          {"touching", ToJson(gap.touching)}};
}

json ToJson(const Identifiability& found, const Eigen::VectorXd& cramer_rao,
            const std::vector<std::string>& names) {
  const auto combination = [](const Combination& c) {
    return json{{"name", c.name}, {"power", ToJson(c.power)}, {"mean", c.mean}, {"sd", c.sd}};
  };
  // A direction with the names of what it moves: people read it without counting columns.
  const auto direction = [&](const Eigen::VectorXd& d) {
    json moves = json::object();
    for (Eigen::Index i = 0; i < std::min(d.size(), static_cast<Eigen::Index>(names.size())); ++i) {
      if (std::abs(d(i)) > 1e-3) moves[names[static_cast<size_t>(i)]] = d(i);
    }
    return json{{"direction", ToJson(d)}, {"moves", moves}};
  };
  return {{"words", found.summary},
          {"information", ToJson(found.information)},
          {"null", List(found.null, direction)},
          {"combinations", List(found.combinations, combination)},
          {"cramer_rao", ToJson(cramer_rao)}};
}

json ToJson(const Holdout& holdout) {
  json found = {{"words", holdout.summary},
                {"better", holdout.better},
                {"fitted", holdout.fitted},
                {"held_out", holdout.held_out},
                {"errors", List(holdout.errors, [](const HorizonError& e) {
                   return json{{"horizon", e.horizon},
                               {"windows", e.windows},
                               {"posterior", e.posterior},
                               {"prior", e.prior},
                               {"corrected", e.corrected}};
                 })}};
  if (const ReplayErrors& replay = holdout.replay; replay.seconds > 0)
    found["replay"] = {
        {"posterior", replay.posterior}, {"prior", replay.prior}, {"seconds", replay.seconds}};
  return found;
}

json ToJson(const Agreement& agreement) {
  return {{"agree", agreement.agree},
          {"words", agreement.summary},
          {"logs", List(agreement.logs, [](const LogAgreement& l) {
             return json{{"log", l.log},
                         {"mean", ToJson(l.mean)},
                         {"sd", ToJson(l.sd)},
                         {"distance", l.distance},
                         {"p", l.p}};
           })}};
}

json ToJson(const CurriculumStage& s) {
  return {{"horizon", s.horizon},
          {"windows", s.windows},
          {"simulated_steps", s.simulated_steps},
          {"discrepancy", s.discrepancy},
          {"mean", ToJson(s.mean)},
          {"sd", ToJson(s.sd)}};
}

json ToJson(const LoopUpdate& update) {
  return {{"iteration", update.iteration},
          {"utime", update.utime},
          {"kl", update.kl},
          {"ess", update.ess},
          {"temperature", update.temperature},
          {"explained", update.explained},
          {"informed", Name(update.informed)},
          {"alarm", update.alarm},
          {"gap", update.gap}};
}

json Interval(const Summary& summary) {
  json interval = json::array();
  for (Eigen::Index i = 0; i < summary.lower.size(); ++i)
    interval.push_back({summary.lower(i), summary.upper(i)});
  return interval;
}

json PriorJson(const Gaussian& prior, const Summary& summary) {
  const Eigen::VectorXd coordinate_sd = prior.covariance.diagonal().cwiseSqrt();
  return {{"mean", ToJson(summary.prior_mean)},
          {"sd", ToJson(summary.prior_sd)},
          {"coordinate_mean", ToJson(prior.mean)},
          {"coordinate_sd", ToJson(coordinate_sd)},
          {"coordinate_covariance", ToJson(prior.covariance)}};
}

json StartJson(const Eigen::VectorXd& start) {
  json list = json::array();
  for (const double number : start) list.push_back(ShortestSingle(number));
  return list;
}

json Versions() {
  return {{"plumbline", VersionLine("plumb")},
          {"eigen",
           fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
          {"compiler", __VERSION__}};
}

json RunJson(const Findings& findings, const Provenance& provenance) {
  return {
      {"seconds", findings.seconds}, {"date", provenance.date}, {"command", provenance.command}};
}

// Of an iteration of the loop, what is not looked into there is null.
void AddLoop(const LoopUpdate& loop, json* j) {
  for (const char* unknown : {"check", "alarm", "gap", "advice", "holdout", "agreement", "noise_sd",
                              "simulations", "stages"})
    (*j)[unknown] = nullptr;
  (*j)["loop"] = ToJson(loop);
}

}  // namespace

Provenance ProvenanceOf(std::span<const Log> logs, const CalibrationOptions& options,
                        const std::string& command, std::time_t now) {
  Provenance provenance;
  for (const Log& log : logs) provenance.logs.push_back(Printable(log.name));
  provenance.options = {{"horizons", fmt::format("{}", fmt::join(options.horizons, ", "))},
                        {"budget", std::to_string(options.budget)},
                        {"discrepancy", options.discrepancy},
                        {"residual", options.residual ? "yes" : "no"}};
  provenance.command = Printable(command);
  provenance.date = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(now));
  return provenance;
}

std::string PosteriorJson(const Findings& findings, const RobotDescription& robot,
                          const Provenance& provenance) {
  const Summary summary = Summarise(findings, robot);
  const std::vector<ParameterDescription>& parameters = robot.parameters;
  std::vector<std::string> names;
  names.reserve(parameters.size());
  for (const ParameterDescription& p : parameters) names.push_back(p.name);
  json j{{"format", kPosteriorFormat},
         {"version", kPosteriorVersion},
         {"robot", robot.name},
         {"fingerprint", Hexadecimal(robot.fingerprint)},
         {"physics", Hexadecimal(PhysicsFingerprint(robot))},
         {"logs", provenance.logs},
         {"options", provenance.options},
         {"seed", findings.seed},
         {"method", {{"asked", findings.method}, {"used", findings.used}}},
         {"names", names},
         {"units", List(parameters, [](const ParameterDescription& p) { return p.unit; })},
         {"coordinates", List(parameters, [](const ParameterDescription& p) { return ToJson(p); })},
         {"prior", PriorJson(findings.prior, summary)},
         {"mean", ToJson(summary.mean)},
         {"sd", ToJson(summary.sd)},
         {"interval_95", Interval(summary)},
         {"covariance", ToJson(summary.covariance)},
         {"coordinate_mean", ToJson(summary.coordinates.mean)},
         {"coordinate_covariance", ToJson(summary.coordinates.covariance)},
         {"mixture", ToJson(findings.posterior)},
         {"check", findings.check},
         {"alarm", ToJson(findings.misspecification)},
         {"gap", ToJson(findings.gap)},
         {"identifiability", ToJson(findings.identifiability, findings.cramer_rao, names)},
         {"advice", findings.advice},
         {"holdout", ToJson(findings.holdout)},
         {"agreement", ToJson(findings.agreement)},
         {"discrepancy", findings.discrepancy},
         {"noise_sd", ToJson(findings.noise_sd)},
         {"transitions", findings.transitions},
         {"simulations",
          {{"fit_steps", findings.simulated_steps},
           {"diagnostic_steps", findings.diagnostic_steps},
           {"failures", findings.failures}}},
         {"stages", List(findings.stages, [](const CurriculumStage& s) { return ToJson(s); })},
         {"warnings", findings.warnings},
         {"samples", Samples(summary.samples)},
         {"residual", findings.gap.residual ? ResidualJson(*findings.gap.residual) : json()},
         {"starts", List(findings.starts, StartJson)},
         {"versions", Versions()}};
  if (findings.loop) AddLoop(*findings.loop, &j);
  j["run"] = findings.loop ? json() : RunJson(findings, provenance);
  return JsonLines(j);
}

void WritePosterior(const std::filesystem::path& file, const Findings& findings,
                    const RobotDescription& robot, const Provenance& provenance) {
  WriteAtomically(file, PosteriorJson(findings, robot, provenance));
}

}  // namespace plumb
