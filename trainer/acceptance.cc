#include "trainer/acceptance.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "common/gaussian.h"
#include "common/special_numbers.h"

namespace plumb {
namespace {

// E of the steps until a fall, at most m, of a hazard ~ Gamma(1 + falls, rate):
//   E (1 - e^(-lambda m)) / lambda = integral over x < m of (rate / (rate + x))^(1 + falls)
double ExpectedSteps(int falls, double rate, double m) {
  if (falls == 0) return rate * std::log1p(m / rate);
  return rate / falls * (1 - std::pow(rate / (rate + m), falls));
}

struct Normal {
  double mean = 0, variance = 0;
};

// Two independent measurements of one thing, by inverse-variance weighting; one of the
// variances may be 0.
Normal Fused(const Normal& a, const Normal& b) {
  const double sum = a.variance + b.variance;
  return {(b.variance * a.mean + a.variance * b.mean) / sum, a.variance * b.variance / sum};
}

double ProbabilityPositive(const Normal& x) {
  if (x.variance == 0) return x.mean > 0 ? 1 : x.mean < 0 ? 0 : 0.5;
  return NormalCdf(x.mean / std::sqrt(x.variance));
}

}  // namespace

Acceptance::Simulated Acceptance::Simulated::Of(std::span<const double> challenger,
                                                std::span<const double> incumbent) {
  if (challenger.size() != incumbent.size())
    throw std::invalid_argument(
        fmt::format("{} simulated returns of the challenger, {} of the incumbent",
                    challenger.size(), incumbent.size()));
  std::vector<double> challengers, incumbents, differences;
  for (size_t i = 0; i < challenger.size(); ++i) {
    if (!std::isfinite(challenger[i] - incumbent[i])) continue;
    challengers.push_back(challenger[i]);
    incumbents.push_back(incumbent[i]);
    differences.push_back(challenger[i] - incumbent[i]);
  }
  const double pairs = std::max<double>(static_cast<double>(differences.size()), 1);
  return {Evaluate(challengers).mean, Evaluate(incumbents).mean,
          Scatter(differences) / std::sqrt(pairs)};
}

Acceptance::Beginnings Acceptance::Beginnings::Of(std::span<const double> trials,
                                                  std::span<const double> whole) {
  return {Evaluate(trials).mean, Scatter(trials), Scatter(whole)};
}

void Acceptance::Add(int iteration, const Trial& trial) {
  trials_[iteration].push_back(trial);
  if (incumbent_ < 0) incumbent_ = iteration;
}

double Acceptance::MeanReturn(int iteration) const {
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
  double sum = 0;
  for (const Trial& trial : found->second) {
    const double left = steps_ - trial.steps;
    sum += trial.sum_of_rewards;
    sum += trial.Continuation(
        all_falls > 0 ? ExpectedSteps(falls, all_steps / all_falls + steps, left) : left);
  }
  return sum / static_cast<double>(found->second.size());
}

int Acceptance::longest_trial() const {
  int longest = 0;
  for (const auto& [policy, trials] : trials_)
    for (const Trial& trial : trials) longest = std::max(longest, trial.steps);
  return longest;
}

double Acceptance::Better(int challenger, const Beginnings& beginnings,
                          const Simulated& simulated) const {
  const auto variance = [&](int iteration) {
    const double sd = beginnings.decide() ? beginnings.trial_sd
                                          : std::max(beginnings.whole_sd,
                                                     kScatter * std::abs(MeanReturn(iteration)));
    return sd * sd / static_cast<double>(trials_.at(iteration).size());
  };
  Normal difference{MeanReturn(challenger) - MeanReturn(incumbent_),
                    variance(challenger) + variance(incumbent_)};
  const double in_simulation = simulated.challenger - simulated.incumbent;
  if (std::isfinite(in_simulation)) {
    if (beginnings.decide()) {
      const double sd = std::hypot((1 - kSimulated) * in_simulation, simulated.difference_sd);
      const double apart = difference.mean - in_simulation;
      difference = Fused(difference,
                         {in_simulation, std::max(sd * sd, apart * apart - difference.variance)});
    } else {
      difference.mean += kSimulated * in_simulation;
    }
  }
  return ProbabilityPositive(difference);
}

Acceptance::Decision Acceptance::Decide(int challenger, const Beginnings& beginnings,
                                        const Simulated& simulated) {
  Decision decision;
  decision.challenger = challenger, decision.incumbent = incumbent_;
  decision.probability = Better(challenger, beginnings, simulated);
  decision.challenger_return = MeanReturn(challenger);
  decision.incumbent_return = MeanReturn(incumbent_);
  decision.simulated = simulated;
  decision.accepted = challenger != incumbent_ && decision.probability >= kSure;
  if (decision.accepted) incumbent_ = challenger;
  return decision;
}

Acceptance::Decision Acceptance::Trust(int challenger, const Beginnings& beginnings) {
  const auto tried = [&](int iteration) { return trials_.contains(iteration); };
  Decision decision;
  decision.challenger = challenger, decision.incumbent = incumbent_;
  decision.accepted = decision.trusted = true;
  decision.probability = decision.challenger_return = decision.incumbent_return = kNaN;
  decision.simulated = {kNaN, kNaN};
  if (tried(challenger)) decision.challenger_return = MeanReturn(challenger);
  if (tried(incumbent_)) decision.incumbent_return = MeanReturn(incumbent_);
  if (tried(challenger) && tried(incumbent_))
    decision.probability = Better(challenger, beginnings, decision.simulated);
  incumbent_ = challenger;
  return decision;
}

Acceptance::Decision Acceptance::Choose(Trainer& trainer, const GaussianPolicy& incumbent,
                                        int challenger, const ParameterDistribution& learnt) {
  const auto trials = [&](int steps) { return trainer.TrialReturns(learnt.Mean(), steps); };
  const auto beginnings = Beginnings::Of(trials(std::max(1, longest_trial())), trials(steps_));
  if (learnt.explained) return Trust(challenger, beginnings);
  const auto simulated = [&](const GaussianPolicy& policy) {
    const ParameterSampler sample = [&](Random& random) { return learnt.Draw(random); };
    return trainer.HeldOutReturns(policy, sample, kSimulators);
  };
  return Decide(challenger, beginnings,
                Simulated::Of(simulated(trainer.policy()), simulated(incumbent)));
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
    text += fmt::format("; incumbent {}: {:.4g}", d.incumbent, d.incumbent_return);
    if (std::isfinite(d.simulated.challenger - d.simulated.incumbent))
      text +=
          fmt::format("; simulated {:.4g}, {:.4g}", d.simulated.challenger, d.simulated.incumbent);
    text += fmt::format("; better with {:.0f} %", 100 * d.probability);
  }
  return text + ")";
}

}  // namespace plumb
