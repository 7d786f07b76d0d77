#include "calibrator/fit/curriculum.h"
#include "calibrator/fit/estimated_noise.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "calibrator/fit/mode_search.h"
#include "calibrator/fit/recorded_window.h"
#include "calibrator/fit/robot_least_squares.h"
#include "calibrator/inference/noise.h"
#include "common/decompositions.h"

namespace plumb {
namespace {

constexpr int kNoiseRounds = 4;        // until the noise of beginnings and ends agrees
constexpr double kGrownNoise = 1.15;   // of a stage, relative to the first one's
constexpr double kLargestShift = 3.5;  // [sd] of a mode from one stage to the next

class Curriculum {
 public:
  Curriculum(std::shared_ptr<const Model> model, std::span<const Rollout> rollouts,
             const CurriculumOptions& options)
      : model_(std::move(model)),
        robot_(model_->description()),
        prior_(PriorOf(robot_)),
        rollouts_(rollouts),
        options_(options),
        shortest_(ShortestWindow(rollouts)) {}

  CurriculumFit Run(const Eigen::VectorXd& start) {
    WindowErrors one_step(model_, rollouts_, shortest_, options_.execution);
    result_.noise_known = one_step.noise_known();
    result_.rows = one_step.rows();
    const std::vector<Eigen::VectorXd> guesses = Search(start, one_step.windows());
    std::vector<LaplaceFit> modes;
    Eigen::VectorXd noise;  // that the best mode's errors are whitened by
    double best = -std::numeric_limits<double>::infinity();
    for (const Eigen::VectorXd& guess : guesses) {
      try {
        modes.push_back(FitStage(one_step, guess, kNoiseRounds));
      } catch (const std::invalid_argument& error) {  // it was found with a part of the windows
        if (modes.empty() && &guess == &guesses.back()) throw;
        result_.warnings.push_back(fmt::format("a mode is left out: {}", error.what()));
        continue;
      }
      if (modes.back().log_posterior <= best) continue;
      best = modes.back().log_posterior;
      noise = one_step.noise_sd();
      result_.noise_sd = EstimatedNoise(one_step, modes.back());
    }
    if (noise.size() == 0)
      throw std::invalid_argument("the errors are so great that none explains them better");
    if (modes.size() > 1) one_step.set_noise_sd(noise);
    std::stable_sort(modes.begin(), modes.end(), [](const auto& a, const auto& b) {
      return a.log_posterior > b.log_posterior;
    });
    for (size_t i = 1; i < modes.size(); ++i) {
      if (modes[i].log_posterior > modes[0].log_posterior - kWorthless &&
          AreDistinct(modes[i], modes[0])) {
        result_.others.push_back(std::move(modes[i]));
      }
    }
    result_.fit = std::move(modes[0]);
    result_.one_step = result_.fit;
    first_errors_ = RootMeanSquares(one_step, result_.fit).cwiseProduct(one_step.EndNoise());
    Record(one_step, result_.fit, shortest_);
    // Where one step leaves nothing to explain, more can teach nothing.
    const bool exact = (result_.fit.scale.array() <= Noise::kLeastScale).all();
    for (const int horizon : options_.horizons) {
      if (exact) break;
      if (horizon > shortest_ && !Lengthen(horizon)) break;
    }
    if (result_.horizon > shortest_ ||
        modes.size() > 1) {  // how the one-step errors are at the final mode
      one_step.Linearise(robot_.ToPhysical(result_.fit.mode));
      const Eigen::VectorXd errors = ProblemOf(robot_, one_step).errors(result_.fit.mode);
      result_.one_step.errors = errors.array() / RowScale(one_step, result_.one_step).array();
    }
    Account(one_step);
    result_.fit.simulations = simulations_;
    return std::move(result_);
  }

 private:
  // Modes that several first guesses lead to; the best explanation first.
  // @param windows of the shortest there are.
  std::vector<Eigen::VectorXd> Search(const Eigen::VectorXd& start, int64_t windows) {
    const std::vector<Eigen::VectorXd> guesses =
        FirstGuesses(prior_, options_.starts, options_.seed, start);
    FoundModes found = SearchModes(
        model_, rollouts_, shortest_, windows, guesses, options_.execution, [&](size_t led) {
          options_.progress("first guesses",
                            0.3 * static_cast<double>(led) / static_cast<double>(guesses.size()));
        });
    if (found.impossible > 0) {
      result_.warnings.push_back(fmt::format("{} of {} first guesses could not be simulated",
                                             found.impossible, guesses.size()));
    }
    simulations_ += found.simulations;
    result_.simulated_steps += found.simulated_steps;
    result_.failures += found.failures;
    return std::move(found.modes);
  }

  // Fits until the sensitivity to the initial states, and the noise that both ends share, are those
  // at the mode.
  LaplaceFit FitStage(WindowErrors& errors, const Eigen::VectorXd& start, int rounds) {
    LaplaceFit fit;
    Eigen::VectorXd mode = start;
    const bool exact = errors.starts_known();
    for (int round = 0; round < (exact ? 1 : rounds); ++round) {
      errors.Linearise(robot_.ToPhysical(mode));
      fit = FitLaplace(ProblemOf(robot_, errors), mode);
      simulations_ += fit.simulations;
      const Eigen::VectorXd offset = fit.mode - mode;
      mode = fit.mode;
      if (exact) break;
      const bool settled =
          (offset.array() / fit.posterior.covariance.diagonal().array().sqrt()).abs().maxCoeff() <
              0.1 &&
          (errors.noise_known() || (fit.scale.array().log().abs() < 0.05).all());
      if (settled || round + 1 == rounds) break;
      if (!errors.noise_known()) errors.set_noise_sd(ScaledNoise(errors.noise_sd(), fit));
    }
    // of the errors themselves, whatever they were whitened by
    fit.log_posterior -= errors.LogSpread();
    return fit;
  }

  static Eigen::VectorXd RowScale(const WindowErrors& errors, const LaplaceFit& fit) {
    Eigen::VectorXd scale(static_cast<Eigen::Index>(errors.rows().size()));
    for (size_t i = 0; i < errors.rows().size(); ++i)
      scale(static_cast<Eigen::Index>(i)) = fit.scale(errors.rows()[i].coordinate);
    return scale;
  }

  // @return false if windows of that length do not count.
  bool Lengthen(int horizon) {
    WindowErrors errors(model_, rollouts_, horizon, options_.execution);
    // no two transitions follow each other
    if (errors.windows() == static_cast<int>(errors.steps())) return false;
    if (!result_.noise_known) errors.set_noise_sd(result_.noise_sd);
    LaplaceFit fit;
    try {
      fit = FitStage(errors, result_.fit.mode, 2);
    } catch (const std::invalid_argument& error) {
      Account(errors);
      result_.warnings.push_back(
          fmt::format("windows of {} steps are not used: {}", horizon, error.what()));
      return false;
    }
    Account(errors);
    const double grown = GrownNoise(errors, fit);
    const double shift = Shift(result_.fit, fit);
    std::string why;
    if (!fit.converged)
      why = "the fit does not converge";
    else if (!(grown < kGrownNoise))
      why = fmt::format("their errors are {:.2g} times the noise of one step", grown);
    else if (!(shift < kLargestShift))
      why = fmt::format("they lead {:.2g} standard deviations away from what shorter ones say",
                        shift);
    if (!why.empty()) {
      result_.warnings.push_back(fmt::format("windows of {} steps are not used: {}", horizon, why));
      return false;
    }
    Record(errors, fit, horizon);
    result_.fit = std::move(fit);
    return true;
  }

  // Largest ratio of an entry's errors to what they were at first, less what chance may have made
  // of it.
  double GrownNoise(const WindowErrors& errors, const LaplaceFit& fit) const {
    const Eigen::VectorXd noise = RootMeanSquares(errors, fit).cwiseProduct(errors.EndNoise());
    Eigen::VectorXd rows = Eigen::VectorXd::Zero(noise.size());
    for (const WindowErrors::Row& row : errors.rows()) rows(row.coordinate) += 1;
    double grown = 0;
    for (Eigen::Index c = 0; c < noise.size(); ++c) {
      if (rows(c) == 0) continue;
      const double before = std::max(first_errors_(c), kNegligible * errors.state_scale()(c));
      grown = std::max(grown, noise(c) / before - 3 / std::sqrt(2 * rows(c)));
    }
    return grown;
  }

  // How far a mode has moved, in standard deviations of where it was known before, along the
  // direction where that is most. If both stages are right the difference varies less than the
  // earlier mode does (Hausman, Econometrica 46, 1978).
  static double Shift(const LaplaceFit& before, const LaplaceFit& after) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(before.standard.covariance);
    const Eigen::VectorXd along =
        axes.eigenvectors().transpose() * (after.standard.mean - before.standard.mean);
    return (along.array().abs() / axes.eigenvalues().array().max(1e-300).sqrt()).maxCoeff();
  }

  void Record(const WindowErrors& errors, const LaplaceFit& fit, int horizon) {
    // Relative to the noise as recorded or, where nobody knows it, to that of one step.
    const Eigen::VectorXd relative =
        EstimatedNoise(errors, fit)
            .cwiseQuotient(result_.noise_known ? errors.EndNoise() : result_.noise_sd);
    double squares = 0;
    for (Eigen::Index i = 0; i < fit.errors.size(); ++i) {
      squares +=
          std::pow(fit.errors(i) * relative(errors.rows()[static_cast<size_t>(i)].coordinate), 2);
    }
    result_.stages.push_back({horizon, errors.windows(), errors.simulated_steps(),
                              squares / static_cast<double>(fit.errors.size()), fit.mode,
                              fit.posterior.covariance.diagonal().cwiseSqrt()});
    result_.horizon = horizon;
    const double last = options_.horizons.empty() ? 1 : options_.horizons.back();
    options_.progress(fmt::format("windows of {} step{}", horizon, horizon == 1 ? "" : "s"),
                      0.3 + 0.7 * horizon / std::max(last, 1.0));
  }

  void Account(const WindowErrors& errors) {
    result_.simulated_steps += errors.simulated_steps();
    result_.failures += errors.failures();
  }

  std::shared_ptr<const Model> model_;
  const RobotDescription& robot_;
  Prior prior_;
  std::span<const Rollout> rollouts_;
  const CurriculumOptions& options_;
  const int shortest_;  // window, in control steps: "one step"
  CurriculumFit result_;
  // of one step, root mean square of each entry of (q, v), physical units
  Eigen::VectorXd first_errors_;
  int64_t simulations_ = 0;
};

}  // namespace

CurriculumFit FitCurriculum(std::shared_ptr<const Model> model, std::span<const Rollout> rollouts,
                            const CurriculumOptions& options, const Eigen::VectorXd& start) {
  return Curriculum(std::move(model), rollouts, options).Run(start);
}

}  // namespace plumb
