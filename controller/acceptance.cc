#include "controller/acceptance.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "common/random.h"

namespace plumb {
namespace {

constexpr int kDraws = 4000;
constexpr uint32_t kStream = 0x4163'6365;  // of random numbers; "Acce"

// Expected steps until a fall, at most m.
double ExpectedSteps(double hazard, double m) {
  return hazard * m < 1e-9 ? m : (1 - std::exp(-hazard * m)) / hazard;
}

}  // namespace

void Trial::Add(double reward, int planned) {
  sum_of_rewards += reward;
  ++steps;
  const int late = steps - planned / 2;
  if (late > 0) late_rate += (reward - late_rate) / late;
}

double Trial::WholeReturn(int episode_steps) const {
  return sum_of_rewards + (fell ? 0 : late_rate * (episode_steps - steps));
}

void Acceptance::Add(int iteration, const Trial& trial) {
  trials_[iteration].push_back(trial);
  if (incumbent_ < 0) incumbent_ = iteration;
}

// Draws of a policy's return: its falls and its scatter are uncertain.
std::vector<double> Acceptance::Returns(int iteration) const {
  const auto found = trials_.find(iteration);
  if (found == trials_.end())
    throw std::invalid_argument(fmt::format("policy {} has had no trial", iteration));
  double all_steps = 0, all_falls = 0, steps = 0;
  int falls = 0;
  for (const auto& [policy, trials] : trials_) {
    for (const Trial& trial : trials) {
      all_steps += trial.steps, all_falls += trial.fell;
      if (policy == iteration) steps += trial.steps, falls += trial.fell;
    }
  }
  Random random(0, {kStream, static_cast<uint32_t>(iteration)});
  std::vector<double> returns(kDraws);
  for (double& one : returns) {
    double hazard = 0;
    if (all_falls > 0) {
      for (int i = 0; i <= falls; ++i) hazard -= std::log(1 - random.Uniform());
      hazard /= all_steps / all_falls + steps;
    }
    for (const Trial& trial : found->second) {
      one += trial.sum_of_rewards;
      if (!trial.fell) one += trial.late_rate * ExpectedSteps(hazard, steps_ - trial.steps);
    }
    const auto n = static_cast<double>(found->second.size());
    one /= n;
    one += kScatter / std::sqrt(n) * std::abs(one) * random.Normal();
  }
  return returns;
}

double Acceptance::MeanReturn(int iteration) const {
  const std::vector<double> returns = Returns(iteration);
  return std::accumulate(returns.begin(), returns.end(), 0.0) / kDraws;
}

double Acceptance::Better(int challenger) const {
  const std::vector<double> theirs = Returns(challenger), ours = Returns(incumbent_);
  int better = 0;
  for (size_t i = 0; i < theirs.size(); ++i) better += theirs[i] > ours[i];
  return static_cast<double>(better) / kDraws;
}

Acceptance::Decision Acceptance::Decide(int challenger) {
  Decision decision{challenger,
                    incumbent_,
                    false,
                    false,
                    Better(challenger),
                    MeanReturn(challenger),
                    MeanReturn(incumbent_)};
  decision.accepted = challenger != incumbent_ && decision.probability >= kSure;
  if (decision.accepted) incumbent_ = challenger;
  return decision;
}

Acceptance::Decision Acceptance::Trust(int challenger) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  const auto tried = [&](int iteration) { return trials_.contains(iteration); };
  Decision decision{challenger, incumbent_, true, true, kUnknown, kUnknown, kUnknown};
  if (tried(challenger)) decision.challenger_return = MeanReturn(challenger);
  if (tried(incumbent_)) decision.incumbent_return = MeanReturn(incumbent_);
  if (tried(challenger) && tried(incumbent_)) decision.probability = Better(challenger);
  incumbent_ = challenger;
  return decision;
}

std::string Summary(const Acceptance::Decision& d) {
  const bool first = d.incumbent < 0 || d.challenger == d.incumbent;
  std::string text = fmt::format("policy {} {}", d.challenger,
                                 first        ? "is the first"
                                 : d.trusted  ? "trusted: the model explains the robot"
                                 : d.accepted ? "accepted"
                                              : "not accepted");
  if (!std::isfinite(d.challenger_return)) return text;
  text += fmt::format(" ({:.4g}", d.challenger_return);
  if (!first && std::isfinite(d.incumbent_return)) {
    text += fmt::format("; incumbent {}: {:.4g}; better with {:.0f} %", d.incumbent,
                        d.incumbent_return, 100 * d.probability);
  }
  return text + ")";
}

}  // namespace plumb
