#include "trainer/acceptance.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "common/special_numbers.h"

namespace plumb {
namespace {

// E of the steps until a fall, at most m, of a hazard ~ Gamma(1 + falls, rate):
//   E (1 - e^(-lambda m)) / lambda = integral over x < m of (rate / (rate + x))^(1 + falls)
double ExpectedSteps(int falls, double rate, double m) {
  if (falls == 0) return rate * std::log1p(m / rate);
  return rate / falls * (1 - std::pow(rate / (rate + m), falls));
}

}  // namespace

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

double Acceptance::Better(int challenger, double scatter, const Simulated& simulated) const {
  const auto variance = [&](int iteration) {
    const double sd = std::max(scatter, kScatter * std::abs(MeanReturn(iteration)));
    return sd * sd / static_cast<double>(trials_.at(iteration).size());
  };
  const double in_simulation = simulated.challenger - simulated.incumbent;
  const double difference = MeanReturn(challenger) - MeanReturn(incumbent_) +
                            (std::isfinite(in_simulation) ? kSimulated * in_simulation : 0),
               sd = std::sqrt(variance(challenger) + variance(incumbent_));
  if (sd == 0) return difference > 0 ? 1 : difference < 0 ? 0 : 0.5;
  return std::erfc(-difference / sd / std::sqrt(2.0)) / 2;
}

Acceptance::Decision Acceptance::Decide(int challenger, double scatter,
                                        const Simulated& simulated) {
  Decision decision;
  decision.challenger = challenger, decision.incumbent = incumbent_;
  decision.probability = Better(challenger, scatter, simulated);
  decision.challenger_return = MeanReturn(challenger);
  decision.incumbent_return = MeanReturn(incumbent_);
  decision.simulated = simulated;
  decision.accepted = challenger != incumbent_ && decision.probability >= kSure;
  if (decision.accepted) incumbent_ = challenger;
  return decision;
}

Acceptance::Decision Acceptance::Trust(int challenger, double scatter) {
  const auto tried = [&](int iteration) { return trials_.contains(iteration); };
  Decision decision;
  decision.challenger = challenger, decision.incumbent = incumbent_;
  decision.accepted = decision.trusted = true;
  decision.probability = decision.challenger_return = decision.incumbent_return = kNaN;
  decision.simulated = {kNaN, kNaN};
  if (tried(challenger)) decision.challenger_return = MeanReturn(challenger);
  if (tried(incumbent_)) decision.incumbent_return = MeanReturn(incumbent_);
  if (tried(challenger) && tried(incumbent_))
    decision.probability = Better(challenger, scatter, decision.simulated);
  incumbent_ = challenger;
  return decision;
}

Acceptance::Decision Acceptance::Choose(Trainer& trainer, const GaussianPolicy& incumbent,
                                        int challenger, const ParameterDistribution& learnt) {
  const double scatter = trainer.ScatterOfStarts(learnt.Mean());
  if (learnt.explained) return Trust(challenger, scatter);
  const auto simulated = [&](const GaussianPolicy& policy) {
    const ParameterSampler sample = [&](Random& random) { return learnt.Draw(random); };
    return trainer.EvaluateHeldOut(policy, sample, kSimulators).mean;
  };
  return Decide(challenger, scatter, {simulated(trainer.policy()), simulated(incumbent)});
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
