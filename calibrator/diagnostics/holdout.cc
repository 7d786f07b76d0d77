#include "calibrator/diagnostics/holdout.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "calibrator/diagnostics/corrected_prediction.h"
#include "calibrator/fit/recorded_window.h"

namespace plumb {
namespace {

constexpr size_t kFew = 5;  // roll-outs
constexpr size_t kLeast = 10;
constexpr double kRounding = 1e-9;  // of a simulation, standard units: who is better by less is not
constexpr std::array<int, 6> kHorizons{1, 2, 5, 10, 20, 50};

int64_t CountWindows(std::span<const Rollout> rollouts, int horizon) {
  int64_t count = 0;
  const auto length = static_cast<size_t>(horizon);
  for (const Rollout& rollout : rollouts) {
    for (size_t i = 0; i < rollout.transitions.size(); ++i) count += IsJudged(rollout, i, length);
  }
  return count;
}

// Mean number of entries of (q, v) that were observed at the end of a transition.
double ObservedEntries(std::span<const Rollout> rollouts) {
  double entries = 0, transitions = 0;
  for (const Rollout& rollout : rollouts) {
    for (const Transition& t : rollout.transitions) {
      entries += static_cast<double>(t.next_q.array().isFinite().count() +
                                     t.next_v.array().isFinite().count());
      ++transitions;
    }
  }
  return std::max(1.0, entries / std::max(1.0, transitions));
}

// [s]
double LongestStretch(std::span<const Rollout> rollouts) {
  double longest = 0;
  for (const Rollout& rollout : rollouts) {
    const auto& t = rollout.transitions;
    for (size_t begin = 0, length = 0; begin < t.size(); begin += length) {
      length = StretchLength(rollout, begin);
      double seconds = 0;
      for (size_t i = begin; i < begin + length; ++i) seconds += t[i].duration();
      longest = std::max(longest, seconds);
    }
  }
  return longest;
}

// The longest horizon of which there are windows; null = none.
const HorizonError* Farthest(const std::vector<HorizonError>& errors) {
  const HorizonError* last = nullptr;
  for (const HorizonError& error : errors) {
    if (error.windows > 0) last = &error;
  }
  return last;
}

struct Verdict {
  bool better = false;  // than the prior at some horizon
  std::string worse;    // at which ones

  // @param entries of a state that are observed.
  void Count(const HorizonError& error, double entries) {
    // A root mean square of so many errors is known that well; where noise is most of it the two
    // are alike.
    const double chance = 1 / std::sqrt(2.0 * static_cast<double>(error.windows) * entries);
    if (error.posterior + kRounding < error.prior * (1 - chance))
      better = true;
    else if (!(error.posterior <= error.prior * (1 + chance) + kRounding))  // or not finite
      worse += fmt::format("{}{}", worse.empty() ? "" : ", ", error.horizon);
  }
};

std::string Summarise(const Holdout& result, const Verdict& verdict) {
  const HorizonError* last = Farthest(result.errors);
  if (!last) {
    return "too few transitions to hold any out: whether the posterior predicts better than the "
           "prior is not known";
  }
  if (result.better) {
    const HorizonError& first = result.errors[0];
    return fmt::format(
        "on {} transitions that it has not seen, the posterior predicts better than the prior: "
        "errors are {:.3g} times the prior's after 1 step, {:.3g} times after {}",
        result.held_out, first.posterior / first.prior, last->posterior / last->prior,
        last->horizon);
  }
  if (verdict.worse.empty()) {
    return fmt::format(
        "on {} transitions that it has not seen, the posterior predicts no better than the prior: "
        "train with the prior, and record motion that tells more",
        result.held_out);
  }
  return fmt::format(
      "on {} transitions that it has not seen, the posterior predicts WORSE than the prior {} "
      "step{} ahead: train with the prior, until the model explains what was recorded",
      result.held_out, verdict.worse, verdict.worse == "1" ? "" : "s");
}

}  // namespace

Split HoldOut(std::span<const Rollout> rollouts) {
  Split split;
  if (CountTransitions(rollouts) < kLeast) {
    split.fitted.assign(rollouts.begin(), rollouts.end());
    return split;
  }
  for (size_t i = 0; i < rollouts.size(); ++i) {
    if (rollouts.size() >= kFew) {
      (i % kFew == kFew - 1 ? split.held_out : split.fitted).push_back(rollouts[i]);
      continue;
    }
    const auto& all = rollouts[i].transitions;
    const auto border = all.begin() + static_cast<std::ptrdiff_t>(all.size() - all.size() / kFew);
    Rollout first = rollouts[i], last = rollouts[i];
    first.transitions.assign(all.begin(), border);
    last.transitions.assign(border, all.end());
    split.fitted.push_back(std::move(first));
    split.held_out.push_back(std::move(last));
  }
  return split;
}

Holdout Judge(Discrepancy& discrepancy, const Split& split, const Eigen::VectorXd& posterior,
              const Eigen::VectorXd& prior, bool replay) {
  Holdout result;
  result.fitted = static_cast<int64_t>(CountTransitions(split.fitted));
  result.held_out = static_cast<int64_t>(CountTransitions(split.held_out));
  const double entries = split.held_out.empty() ? 1 : ObservedEntries(split.held_out);
  Eigen::MatrixXd both(posterior.size(), 2);
  both << posterior, prior;
  if (replay && result.held_out > 0) {
    const Eigen::VectorXd replayed = discrepancy.ReplayError(both, split.held_out);
    result.replay = {replayed(0), replayed(1), LongestStretch(split.held_out)};
  }
  Verdict verdict;
  for (const int horizon : kHorizons) {
    HorizonError error{horizon, CountWindows(split.held_out, horizon), NAN, NAN, NAN};
    if (error.windows > 0) {
      const Eigen::VectorXd errors = discrepancy.PredictionError(both, split.held_out, horizon);
      error.posterior = errors(0), error.prior = errors(1);
      verdict.Count(error, entries);
    }
    result.errors.push_back(error);
  }
  result.better = verdict.better && verdict.worse.empty();
  result.summary = Summarise(result, verdict);
  return result;
}

void JudgeResidual(const std::shared_ptr<const Model>& model, const Residual& residual,
                   const Split& split, const Eigen::VectorXd& posterior, Holdout* holdout) {
  const Eigen::VectorXd errors =
      CorrectedPredictionErrors(model, posterior, residual, split.held_out, kHorizons);
  for (size_t i = 0; i < holdout->errors.size(); ++i)
    holdout->errors[i].corrected = errors[static_cast<Eigen::Index>(i)];
  const HorizonError* last = Farthest(holdout->errors);
  if (!last) return;
  const auto ratio = [](const HorizonError& error) { return error.corrected / error.posterior; };
  holdout->summary += fmt::format(
      "; with the residual of what was fitted its errors are {:.3g} times those "
      "without after 1 step, {:.3g} times after {}",
      ratio(holdout->errors[0]), ratio(*last), last->horizon);
}

}  // namespace plumb
