#include "cli/progress.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/median.h"
#include "common/outside_text.h"
#include "controller/trial.h"
#include "plumb/policy_t.hpp"

namespace plumb {
namespace {

double Mean(const std::vector<double>& values) {
  return values.empty() ? NAN
                        : std::accumulate(values.begin(), values.end(), 0.0) /
                              static_cast<double>(values.size());
}

const char* DriverState(int8_t state) {
  switch (state) {
    case driver_status_t::IDLE:
      return "idle";
    case driver_status_t::ARMING:
      return "arming";
    case driver_status_t::ARMED:
      return "armed";
    case driver_status_t::FAULT:
      return "FAULT";
    default:
      return "absent";
  }
}

// Three decimals; more where a standard deviation would be none of them.
int Decimals(double sd) {
  return sd > 0 && sd < 5e-4 ? std::min(12, static_cast<int>(std::ceil(1 - std::log10(sd)))) : 3;
}

std::string PlusMinus(double mean, double sd) {
  return fmt::format("{0:.{2}f} ± {1:.{2}f}", mean, sd, Decimals(sd));
}

std::string OrDash(double value) {
  return std::isfinite(value) ? fmt::format("{:.0f}", value) : "-";
}

// Width in terminal cells: UTF-8 continuation bytes take none. What is wider keeps one blank.
std::string Pad(const std::string& text, size_t width) {
  const auto cells = static_cast<size_t>(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xc0) != 0x80;
  }));
  return std::string(cells < width ? width - cells : 1, ' ') + text;
}

std::string Title(const ParameterDescription& parameter) {
  return parameter.name + " [" + parameter.unit + "]";
}

// Of a parameter's column: as wide as mean and sd, and two blanks before a longer title.
size_t Width(const ParameterDescription& parameter) {
  return std::max<size_t>(20, Title(parameter).size() + 2);
}

// Of a whole episode. A roll-out that is to calibrate with begins with a trial, which tells.
double RobotReturn(const RobotDescription& robot, const controller_status_t& status) {
  const bool tried = status.purpose == policy_t::CALIBRATE && robot.training.trial > 0;
  if (!tried || status.num_episodes < 2) return Mean(status.returns);
  const Trial trial{status.steps[0], status.returns[0], status.late_rate[0], status.fell[0] != 0};
  return trial.WholeReturn(robot.task.steps);
}

}  // namespace

void Progress::OnDriver(const driver_status_t& status) {
  driver_ = status;
  driver_.reason = Printable(status.reason);
}

void Progress::OnController(const controller_status_t& status) {
  controller_ = status;
  controller_.reason = Printable(status.reason);
  // Nothing is remembered of policies that this run does not have.
  if (status.policy_iteration < 0 || status.policy_iteration > iterations_) return;
  if (status.phase != controller_status_t::COMPLETE) return;
  robot_return_[status.policy_iteration] = RobotReturn(robot_, status);
  if (status.purpose == policy_t::EVALUATE && status.policy_iteration == iterations_) {
    evaluation_ = status.returns;
    finished_ = true;
  }
}

void Progress::OnTraining(const training_status_t& status) {
  training_ = status;
  training_.decision = Printable(status.decision);
  const bool known = status.iteration >= 0 && status.iteration <= iterations_;
  if (status.complete && known) simulated_return_[status.iteration] = status.evaluation_return;
  if (status.decision.empty() || status.challenger < 0 || status.challenger > iterations_ ||
      decisions_.contains(status.challenger))
    return;
  decisions_[status.challenger] = {training_.decision, status.incumbent == status.challenger,
                                   status.probability, status.challenger_return,
                                   status.incumbent_return};
  decided_.push_back("      " + training_.decision);
}

void Progress::OnCalibration(const calibration_status_t& status) {
  const int known = done_.empty() ? 0 : done_.back().calibration.iteration;
  // Anybody can send anything: sizes that do not fit together are somebody else's message.
  if (status.iteration <= known || status.iteration > iterations_ ||
      status.num_parameters != static_cast<int>(robot_.parameters.size()) ||
      status.num_powers != status.num_parameters * status.num_combinations) {
    return;
  }
  const auto or_nan = [](const std::map<int, double>& values, int key) {
    const auto found = values.find(key);
    return found == values.end() ? NAN : found->second;
  };
  // Distribution k rests on the roll-out of policy k - 1.
  calibration_status_t printable = status;
  for (std::string* text : {&printable.alarm, &printable.gap, &printable.identifiability})
    *text = Printable(*text);
  for (std::string& name : printable.combination) name = Printable(name);
  done_.push_back({std::move(printable), or_nan(simulated_return_, status.iteration - 1),
                   or_nan(robot_return_, status.iteration - 1), spent_.accounted - last_row_});
  last_row_ = spent_.accounted;
  finished_ = finished_ || (calibrates_only_ && status.iteration == iterations_);
}

double& Progress::Spent::Doing(const controller_status_t& c, const training_status_t& t) {
  if (c.phase == controller_status_t::RUNNING || c.phase == controller_status_t::PLACING)
    return robot;
  return !t.complete && t.updates > 0 ? training : other;
}

void Progress::Spent::Account(double now, const controller_status_t& c,
                              const training_status_t& t) {
  Doing(c, t) += now - accounted;
  accounted = now;
}

void Progress::Account(double seconds, double real_seconds) {
  spent_.Account(seconds, controller_, training_);
  really_spent_.Account(real_seconds, controller_, training_);
}

std::string Progress::Header() const {
  std::string header = "iter";
  for (const ParameterDescription& p : robot_.parameters) header += Pad(Title(p), Width(p));
  header += Pad("discrepancy", 13);
  for (const int n : robot_.calibration.horizons) header += Pad(fmt::format("{}-step", n), 9);
  return header + "      KL   ESS  return sim  robot      s";
}

std::string Progress::Row(const Iteration& iteration) const {
  const calibration_status_t& c = iteration.calibration;
  std::string row = fmt::format("{:4d}", c.iteration);
  for (size_t i = 0; i < c.mean.size(); ++i)
    row += Pad(PlusMinus(c.mean[i], c.sd[i]), Width(robot_.parameters[i]));
  row += fmt::format("{:13.2f}", c.discrepancy);
  for (const double error : c.error_before) row += fmt::format("{:9.4f}", error);
  return row + fmt::format("{:8.3f}{:>6}{:>12}{:>7}{:7.1f}", c.kl,
                           std::isnan(c.ess) ? "-" : fmt::format("{:.1f}", c.ess),
                           OrDash(iteration.simulated_return), OrDash(iteration.robot_return),
                           iteration.seconds);
}

std::vector<std::string> Progress::TakeRows() {
  std::vector<std::string> rows;
  for (; taken_ < done_.size(); ++taken_) {
    rows.push_back(Row(done_[taken_]));
    const std::string& gap = done_[taken_].calibration.gap;
    if (!gap.empty()) rows.push_back("      " + gap);
  }
  rows.insert(rows.end(), decided_.begin(), decided_.end());
  decided_.clear();
  return rows;
}

// Why the policy that runs does: its own decision, and the last one where that was another's.
std::string Progress::Why() const {
  std::string why;
  const auto own = decisions_.find(training_.incumbent);
  if (own != decisions_.end()) why = own->second.text;
  if (training_.challenger != training_.incumbent && !training_.decision.empty())
    why += (why.empty() ? "" : "; ") + training_.decision;
  return why;
}

std::string Progress::StatusLine(double seconds) const {
  std::string line = fmt::format("{:5.0f} s  driver {}", seconds, DriverState(driver_.state));
  if (driver_.state == driver_status_t::FAULT) return line + ": " + driver_.reason;
  const auto& c = controller_;
  const char* purpose = c.purpose == policy_t::EVALUATE ? "evaluation" : "roll-out";
  switch (c.phase) {
    case controller_status_t::PLACING:
    case controller_status_t::RUNNING:
      return line + fmt::format("  policy {} {} {}/{}: step {}/{}, return {:.0f}",
                                c.policy_iteration, purpose, c.num_episodes + 1, c.episodes_wanted,
                                c.step, robot_.task.steps, c.episode_return);
    case controller_status_t::HALTED:
      return line + "  controller halted: " + c.reason;
    default:
      break;
  }
  if (training_.updates > 0 && !training_.complete) {
    line += fmt::format("  training policy {}: update {}/{}, return {:.0f}, {:.0f} k steps",
                        training_.iteration, training_.update, training_.updates,
                        training_.mean_return, static_cast<double>(training_.steps) / 1000);
    if (training_.dropped_episodes > 0)
      line += fmt::format(", {} episodes dropped", training_.dropped_episodes);
    if (training_.incumbent >= 0) line += fmt::format("; policy {} runs", training_.incumbent);
    return line;
  }
  if (c.phase == controller_status_t::COMPLETE) return line + "  calibrating";
  return line + "  waiting" + (c.reason.empty() ? "" : ": " + c.reason);
}

std::string Progress::Conclusion(const Eigen::VectorXd& truth) const {
  std::string text;
  if (!done_.empty()) {
    const calibration_status_t& c = done_.back().calibration;
    size_t width = 24;
    for (const ParameterDescription& p : robot_.parameters)
      width = std::max(width, p.name.size() + 3);
    text += fmt::format("{:<{}}{:>22}{:>12}{:>10}\n", "", width, "learned", "hidden", "error");
    const auto line = [&](const std::string& name, double mean, double sd, double real) {
      text += fmt::format("{:<{}}", name, width) + Pad(PlusMinus(mean, sd), 22);
      if (std::isfinite(real))
        text += fmt::format("{:12.{}f}{:9.2f} %", real, Decimals(sd), 100 * (mean / real - 1));
      text += "\n";
    };
    // Where every parameter is determined, each is a combination of its own, which need not be told
    // twice.
    for (size_t i = 0; i < c.combination.size() && c.combination.size() < c.mean.size(); ++i) {
      line(c.combination[i], c.combination_mean[i], c.combination_sd[i],
           truth.size() > 0 ? TrueCombination(c, i, truth) : NAN);
    }
    for (size_t i = 0; i < c.mean.size(); ++i) {
      line("  " + robot_.parameters[i].name, c.mean[i], c.sd[i],
           truth.size() > 0 ? truth(static_cast<Eigen::Index>(i)) : NAN);
    }
    text += c.identifiability + ".\n";
    // Where something is trained the decision on its policy says what to think of the model.
    if (calibrates_only_ && !c.alarm.empty()) text += c.alarm + "\n";
  }
  if (const std::string why = Why(); !why.empty()) {
    text += fmt::format("policy {} runs since iteration {}: {}\n", training_.incumbent,
                        training_.incumbent_since, why);
  }
  if (!evaluation_.empty()) {
    text += fmt::format(
        "final policy on the robot, {} roll-outs: mean return {:.0f}, median {:.0f}, worst "
        "{:.0f}\n",
        evaluation_.size(), Mean(evaluation_), Median(evaluation_),
        *std::min_element(evaluation_.begin(), evaluation_.end()));
  }
  text +=
      fmt::format("time: {:.0f} s on the robot, by its clock", spent_.robot) +
      fmt::format(
          "; {:.0f} s in all: {:.0f} s on the robot, {:.0f} s training, {:.0f} s for the rest\n",
          really_spent_.accounted, really_spent_.robot, really_spent_.training,
          really_spent_.other);
  return text;
}

}  // namespace plumb
