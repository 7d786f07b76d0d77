#include "calibrator/diagnostics/misspecification.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "calibrator/diagnostics/error_tests.h"
#include "calibrator/diagnostics/projected_errors.h"

namespace plumb {
namespace {

constexpr size_t kMaxCauses = 3;        // one after the other
constexpr size_t kMaxTold = 3;          // tests, and places
constexpr double kNearlyAsGood = 0.85;  // of the best one's gain: an alternative
constexpr size_t kMaxAlternatives = 2;
constexpr double kWorthwhile = 0.3;  // share of what is left that a further one has to explain
constexpr double kMostly = 0.8;      // of a gain, in one joint or condition

double LeastEffect(const std::string& test) {
  return test == "scale" ? kLeastExcess : test == "whiteness" ? kLeastCorrelation : kLeastShare;
}

// p of the misfit corrected.
bool Significant(const Misfit& misfit) { return misfit.p < kFalseAlarm; }

bool Counts(const Misfit& misfit) {
  // Of outliers it is how many they are: a single one makes most of a variance.
  if (misfit.test == "outliers") return Significant(misfit) && misfit.statistic >= kLeastOutliers;
  return Significant(misfit) && misfit.effect >= LeastEffect(misfit.test);
}

std::vector<Misfit> TestErrors(const ProjectedErrors& errors,
                               const std::vector<bool>& noise_known) {
  std::vector<Misfit> tests = TestScale(errors, noise_known);
  for (const auto& more :
       {TestOutliers(errors), TestWhiteness(errors), TestBias(errors), TestRegression(errors)}) {
    tests.insert(tests.end(), more.begin(), more.end());
  }
  return tests;
}

// "20 % larger", or "by 0.002 s larger" where there was nothing.
std::string Change(const Candidate& candidate, double change) {
  const char* how = change > 0 ? "larger" : "smaller";
  const bool relative = candidate.value > 1e-3 * candidate.scale && std::isfinite(candidate.lower);
  if (relative)
    return fmt::format("{} {:.2g} % {}", candidate.path, 100 * std::abs(change) / candidate.value,
                       how);
  return fmt::format("{} {:.2g}{}{} {}", candidate.path, std::abs(change),
                     candidate.unit.empty() ? "" : " ", candidate.unit, how);
}

// A candidate and what it would do.
struct Explanation {
  size_t index;
  Eigen::VectorXd column;  // projected
  Score score;
  Misfit misfit;
};

// Where a change of the candidate reduces the errors.
void Locate(const ProjectedErrors& errors, const Explanation& explanation, Misfit* misfit) {
  double contact = 0, total = 0;
  std::vector<std::pair<std::string, double>> joints;
  for (Eigen::Index i = 0; i < errors.r.size(); ++i) {
    const double after = errors.r(i) + explanation.column(i) * explanation.score.change;
    const double gain = errors.r(i) * errors.r(i) - after * after;
    const std::string& joint =
        errors.joint_of[static_cast<size_t>(errors.coordinate[static_cast<size_t>(i)] % errors.n)];
    if (joints.empty() || joints.back().first != joint) {
      const auto known = std::find_if(joints.begin(), joints.end(),
                                      [&](const auto& j) { return j.first == joint; });
      if (known == joints.end()) joints.push_back({joint, 0});
    }
    std::find_if(joints.begin(), joints.end(), [&](const auto& j) {
      return j.first == joint;
    })->second += gain;
    total += gain;
    if (errors.Contact(i)) contact += gain;
  }
  const auto most =
      std::max_element(joints.begin(), joints.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most != joints.end() && joints.size() > 1 && most->second >= kMostly * total)
    misfit->joint = most->first;
  if (errors.conditions && contact >= kMostly * total) misfit->condition = "contact";
  if (errors.conditions && contact <= (1 - kMostly) * total) misfit->condition = "free";
}

// Share of the errors' squares that a change takes away, in the joint where it is the largest.
double Share(const ProjectedErrors& errors, const Eigen::VectorXd& column, double change) {
  Eigen::VectorXd gain = Eigen::VectorXd::Zero(errors.n), squares = gain;
  for (Eigen::Index i = 0; i < errors.r.size(); ++i) {
    const Eigen::Index joint = errors.coordinate[static_cast<size_t>(i)] % errors.n;
    const double before = errors.r(i) * errors.r(i);
    gain(joint) += before - std::pow(errors.r(i) + column(i) * change, 2);
    squares(joint) += before;
  }
  double most = 0;
  for (Eigen::Index joint = 0; joint < errors.n; ++joint) {
    if (squares(joint) > 0) most = std::max(most, gain(joint) / squares(joint));
  }
  return std::min(1.0, most);
}

// Best first.
std::vector<Explanation> FindExplanations(const ProjectedErrors& errors,
                                          const FitResiduals& residuals) {
  std::vector<Explanation> found;
  for (size_t k = 0; k < residuals.candidates.size(); ++k) {
    const Candidate& candidate = residuals.candidates[k];
    const Eigen::VectorXd raw =
        errors.weight.cwiseProduct(residuals.columns.col(static_cast<Eigen::Index>(k)));
    Eigen::VectorXd column = errors.Project(raw);
    // A candidate whose effect is nil, or one of the fitted parameters', cannot be tested.
    if (!(column.norm() > 1e-4 * raw.norm()) || !(column.norm() * candidate.scale > 1e-3)) continue;
    const Score score =
        FindScore(errors, column, candidate.scale, candidate.lower - candidate.value);
    const double share = Share(errors, column, score.change);
    Misfit misfit{
        Change(candidate, score.change), "", "", "structure", score.statistic, score.p, share};
    found.push_back({k, std::move(column), score, std::move(misfit)});
  }
  std::stable_sort(found.begin(), found.end(), [](const Explanation& a, const Explanation& b) {
    return a.score.gain > b.score.gain;
  });
  return found;
}

void Correct(size_t tests, std::vector<Misfit>* misfits) {
  for (Misfit& misfit : *misfits) misfit.p = std::min(1.0, misfit.p * static_cast<double>(tests));
}

// The share that a gain is of the errors beyond the noise, or of all of them where the noise was
// estimated from them.
struct Explained {
  double share;
  std::string summary;
};

Explained Explain(const ProjectedErrors& errors, const std::vector<bool>& noise_known,
                  double gain) {
  const bool known = std::all_of(noise_known.begin(), noise_known.end(), [](bool k) { return k; });
  const double squares = errors.r.squaredNorm(), beyond = squares - errors.freedom.sum();
  const bool of_it = known && beyond > 0;
  const double share = std::min(1.0, gain / (of_it ? beyond : squares));
  return {share, fmt::format("{:.0f} % of {}", 100 * share, of_it ? "it" : "the errors' variance")};
}

// A candidate that the errors speak for, and what is said of it.
struct Cause {
  Misfit misfit;
  std::string line;
};

// " (nearly as well: a; b)" where others would do.
std::string Alternatives(const std::vector<Explanation>& explanations, const Explanation& best) {
  std::vector<std::string> alternatives;
  for (const Explanation& other : explanations) {
    if (&other == &best || other.score.gain < kNearlyAsGood * best.score.gain) continue;
    if (alternatives.size() < kMaxAlternatives) alternatives.push_back(other.misfit.what);
  }
  if (alternatives.empty()) return "";
  return fmt::format(" (nearly as well: {})", fmt::join(alternatives, "; "));
}

// One cause after the other, each of what those before it leave of the errors.
std::vector<Cause> FindCauses(const FitResiduals& residuals, size_t tests,
                              std::vector<Explanation> explanations, ProjectedErrors* errors) {
  std::vector<Cause> causes;
  while (causes.size() < kMaxCauses) {
    for (Explanation& explanation : explanations)
      explanation.misfit.p = std::min(1.0, explanation.misfit.p * static_cast<double>(tests));
    const auto best =
        std::find_if(explanations.begin(), explanations.end(),
                     [](const Explanation& explanation) { return Counts(explanation.misfit); });
    if (best == explanations.end()) break;
    const Explained explained = Explain(*errors, residuals.noise_known, best->score.gain);
    // No model is linear: a little of what the first candidate is about is always left.
    if (!causes.empty() && explained.share < kWorthwhile) break;
    Locate(*errors, *best, &best->misfit);
    causes.push_back(
        {best->misfit,
         fmt::format("{}{} would explain {}{}", causes.empty() ? "" : "of what is left ",
                     best->misfit.what, explained.summary, Alternatives(explanations, *best))});
    errors->Explain(best->column);
    explanations = FindExplanations(*errors, residuals);
  }
  return causes;
}

// The tests that are worth a word, the most telling first.
std::vector<Misfit> Notable(std::vector<Misfit> tests) {
  std::erase_if(tests, [](const Misfit& test) {
    return !Counts(test) && !(test.test == "outliers" && Significant(test));
  });
  std::stable_sort(tests.begin(), tests.end(), [](const Misfit& a, const Misfit& b) {
    return std::pair(Counts(a), a.effect) > std::pair(Counts(b), b.effect);
  });
  return tests;
}

// What the first tests say: "a; b; c".
std::string Told(const std::vector<Misfit>& tests) {
  std::vector<std::string> told;
  for (const Misfit& test : tests) {
    if (told.size() < kMaxTold) told.push_back(test.what);
  }
  return fmt::format("{}", fmt::join(told, "; "));
}

// The first places where something is wrong, each once: "a; b; c".
std::string Places(const ProjectedErrors& errors, const std::vector<Misfit>& misfits) {
  std::vector<std::string> places;
  for (const Misfit& misfit : misfits) {
    const std::string place = errors.Place(misfit.joint, misfit.condition);
    const bool known = std::find(places.begin(), places.end(), place) != places.end();
    if (!known && places.size() < kMaxTold) places.push_back(place);
  }
  return fmt::format("{}", fmt::join(places, "; "));
}

}  // namespace

Misspecification FindMisspecification(const RobotDescription& robot,
                                      const FitResiduals& residuals) {
  Misspecification found;
  ProjectedErrors errors(robot, residuals);
  if (!errors.r.allFinite()) {
    found.alarm = true;
    found.summary = "the simulation fails on this log with the parameters found";
    return found;
  }
  std::vector<Misfit> tests = TestErrors(errors, residuals.noise_known);
  std::vector<Explanation> explanations = FindExplanations(errors, residuals);
  for (const Explanation& explanation : explanations)
    found.changes.push_back({explanation.index, explanation.score.change, explanation.score.gain});
  const size_t count = tests.size() + explanations.size();
  Correct(count, &tests);
  found.alarm = std::any_of(tests.begin(), tests.end(), Counts);

  const std::vector<Cause> causes = FindCauses(residuals, count, std::move(explanations), &errors);
  if (!causes.empty()) {
    found.alarm = true;
    tests = TestErrors(errors, residuals.noise_known);
    Correct(count, &tests);
  }
  tests = Notable(std::move(tests));
  for (const Cause& cause : causes) found.misfits.push_back(cause.misfit);
  found.misfits.insert(found.misfits.end(), tests.begin(), tests.end());

  if (!found.alarm) {
    found.summary = fmt::format("nothing speaks against the model ({} tests of {} errors)", count,
                                errors.r.size());
    if (!tests.empty()) found.summary += ", but look at " + Told(tests);
    return found;
  }
  found.summary = "the model cannot explain this log: " + Places(errors, found.misfits);
  for (const Cause& cause : causes) found.summary += "; " + cause.line;
  if (!tests.empty())
    found.summary += (causes.empty() ? "; " : "; not explained by that: ") + Told(tests);
  return found;
}

}  // namespace plumb
