#include "calibrator/fit/streaming.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "calibrator/fit/recorded_window.h"
#include "calibrator/fit/window_errors.h"
#include "calibrator/inference/slopes.h"

namespace plumb {
namespace {

// With each new transition. More would follow the mode sooner, and in virtual time the robot waits
// for it; looking costs little.
constexpr size_t kLinearisedAgain = 3, kLookedAt = 128;
constexpr double kUnmoved = 0.01;  // [sd] of the posterior: a mode so near is where it was
constexpr double kSettled = 1e-6;  // [sd]
constexpr int kRounds = 30;        // until it has settled
constexpr size_t kSettledAtOnce = 64;
// of the mode, in standard coordinates: slopes are not to be trusted further away
constexpr double kLongestStep = 2;
constexpr double kNoiseOff = 0.05;  // relative

}  // namespace

StreamingLaplace::StreamingLaplace(std::shared_ptr<const Model> model)
    : errors_(std::move(model)),
      n_(errors_.model().num_velocities()),
      p_(errors_.prior().size()),
      mode_(Eigen::VectorXd::Zero(p_)),
      precision_(Eigen::MatrixXd::Identity(p_, p_)),
      noise_sd_(GuessedNoise(errors_.model().description())),
      scale_(Eigen::VectorXd::Ones(2 * n_)),
      sums_(static_cast<int>(2 * n_), mode_),
      next_sums_(sums_) {}

bool StreamingLaplace::Add(const Transition& transition, int64_t episode) {
  std::vector<size_t> turns = NextInTurn();
  if (rollouts_.empty() || rollouts_.back().episode != episode)
    rollouts_.push_back({episode, 0, {}});
  auto& transitions = rollouts_.back().transitions;
  transitions.push_back(transition);
  pieces_.push_back({errors_.Observe(rollouts_, rollouts_.size() - 1, transitions.size() - 1)});
  const std::vector<int>& observed = pieces_.back().transition.coordinates;
  const auto unknown = std::count_if(observed.begin(), observed.end(),
                                     [&](int c) { return !(EndSd(transition, c) > 0); });
  ++left_out_;
  std::vector<size_t> indices{pieces_.size() - 1};
  indices.insert(indices.end(), turns.begin(), turns.end());
  const auto count_turns = [&] {
    for (const size_t i : turns) {
      if (pieces_[i].at.size() > 0)
        next_sums_.Add(pieces_[i].transition.coordinates, pieces_[i].errors, pieces_[i].at);
    }
  };
  try {
    Linearise(indices);
  } catch (...) {
    pieces_.pop_back();
    transitions.pop_back();
    if (transitions.empty()) rollouts_.pop_back();
    --left_out_;
    count_turns();
    throw;
  }
  // with the newest all have had their turn
  if (next_ + 1 == pieces_.size()) turns.push_back(next_++);
  count_turns();
  unknown_rows_ += unknown;
  uncertain_starts_ += pieces_.back().transition.start_uncertain;
  Solve();
  return pieces_.back().at.size() > 0;
}

// Those whose turn it is to be linearised again; those that need not be are in next_sums_ when it
// returns.
std::vector<size_t> StreamingLaplace::NextInTurn() {
  if (next_ == pieces_.size()) {
    sums_ = next_sums_;
    AdaptNoise();
    next_sums_ = GroupSums(static_cast<int>(2 * n_), mode_);
    next_ = 0;
  }
  std::vector<size_t> turns;
  for (size_t looked = 0;
       looked < kLookedAt && turns.size() < kLinearisedAgain && next_ < pieces_.size();
       ++looked, ++next_) {
    const Piece& piece = pieces_[next_];
    if (piece.transition.coordinates.empty()) continue;
    const bool stale = piece.at.size() == 0 || piece.noise_version != noise_version_;
    if (stale || DistanceFrom(piece.at) > kUnmoved)
      turns.push_back(next_);
    else
      next_sums_.Add(piece.transition.coordinates, piece.errors, piece.at);
  }
  return turns;
}

// Of the mode, in posterior standard deviations.
double StreamingLaplace::DistanceFrom(const Eigen::VectorXd& at) const {
  const Eigen::VectorXd offset = mode_ - at;
  return std::sqrt(offset.dot(precision_ * offset));
}

// All at the mode, side by side.
void StreamingLaplace::Linearise(const std::vector<size_t>& indices) {
  std::vector<const ObservedTransition*> transitions;
  transitions.reserve(indices.size());
  for (const size_t i : indices) transitions.push_back(&pieces_[i].transition);
  std::vector<Eigen::MatrixXd> errors = errors_.Linearise(rollouts_, transitions, mode_, noise_sd_);
  for (size_t k = 0; k < indices.size(); ++k) {
    if (errors[k].size() > 0) Replace(pieces_[indices[k]], std::move(errors[k]));
  }
}

void StreamingLaplace::Replace(Piece& piece, Eigen::MatrixXd errors) {
  if (piece.at.size() > 0)
    sums_.TakeAway(piece.transition.coordinates, piece.errors, piece.at);
  else
    --left_out_;
  piece.errors = std::move(errors);
  piece.at = mode_;
  piece.noise_version = noise_version_;
  sums_.Add(piece.transition.coordinates, piece.errors, piece.at);
}

bool StreamingLaplace::determined() const {
  const double rows = sums_.rows().sum();
  return rows > 0 && (unknown_rows_ == 0 || rows >= static_cast<double>(p_ + 3));
}

void StreamingLaplace::Solve() {
  if (!determined()) return;
  const GroupSums::Fit fit = sums_.Solve(unknown_rows_ == 0);
  Eigen::VectorXd step = fit.mode - mode_;
  const double longest = step.cwiseAbs().maxCoeff();
  if (longest > kLongestStep) step *= kLongestStep / longest;
  mode_ += step;
  precision_ = fit.information + Eigen::MatrixXd::Identity(p_, p_);
  scale_ = fit.scale;
}

// Where starts are exact the assumed noise is but a unit. @return true if the assumed noise has
// changed: all whitening is out of date then.
bool StreamingLaplace::AdaptNoise() {
  if (uncertain_starts_ == 0 || unknown_rows_ == 0 || !determined() ||
      (scale_.array().log().abs() < kNoiseOff).all())
    return false;
  noise_sd_ = noise_sd_.cwiseProduct(scale_.cwiseMax(1e-150));
  ++noise_version_;
  return true;
}

bool StreamingLaplace::Settle() {
  if (pieces_.empty()) return true;
  double last_step = std::numeric_limits<double>::infinity();
  Eigen::VectorXd last = Eigen::VectorXd::Zero(p_);  // where the last solution led to
  double share = 1;                                  // of that which is gone
  for (int round = 0; round < kRounds; ++round) {
    std::vector<size_t> some;
    for (size_t i = 0; i < pieces_.size(); ++i) {
      const Piece& piece = pieces_[i];
      const bool settled = piece.at.size() > 0 && piece.noise_version == noise_version_ &&
                           DistanceFrom(piece.at) <= kSettled;
      if (!settled) some.push_back(i);
      if (some.size() == kSettledAtOnce || (i + 1 == pieces_.size() && !some.empty())) {
        Linearise(some);
        some.clear();
      }
    }
    sums_ = GroupSums(static_cast<int>(2 * n_), mode_);
    for (const Piece& piece : pieces_) {
      if (piece.at.size() > 0) sums_.Add(piece.transition.coordinates, piece.errors, piece.at);
    }
    next_sums_ = GroupSums(static_cast<int>(2 * n_), mode_);
    next_ = 0;
    const Eigen::VectorXd before = mode_;
    Solve();
    // To and fro about a place where errors jump: closer and closer to it, to rest where a short
    // step still turns back.
    const Eigen::VectorXd displacement = mode_ - before, scaled = precision_ * last;
    const bool turns = displacement.dot(scaled) < -last.dot(scaled) / 2;
    const double step = DistanceFrom(before);
    last = displacement;
    if (turns) share /= 2;
    if (share < 1) mode_ = before + share * displacement;
    // A short step that is no shorter than the last one is rounding, in a direction that next to
    // nothing is known of.
    const bool rests = step <= kSettled || (step <= kUnmoved && step > last_step / 2) ||
                       (turns && share * step <= kUnmoved);
    last_step = step;
    if (!AdaptNoise() && rests) return true;
  }
  return false;
}

Gaussian StreamingLaplace::standard() const {
  return {mode_, precision_.llt().solve(Eigen::MatrixXd::Identity(p_, p_))};
}

Gaussian StreamingLaplace::posterior() const {
  const Gaussian standard = this->standard();
  const Eigen::VectorXd width = errors_.prior().Slope(mode_);
  return {errors_.prior().FromStandard(mode_),
          width.asDiagonal() * standard.covariance * width.asDiagonal()};
}

}  // namespace plumb
