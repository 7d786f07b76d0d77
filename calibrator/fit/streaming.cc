#include "calibrator/fit/streaming.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "calibrator/fit/physical_columns.h"
#include "calibrator/fit/recorded_window.h"
#include "calibrator/fit/robot_least_squares.h"
#include "calibrator/fit/whitening.h"
#include "calibrator/fit/window_errors.h"
#include "calibrator/inference/laplace.h"
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
    : model_(std::move(model)),
      prior_(PriorOf(model_->description())),
      windows_(model_, 1),
      space_(model_->description()),
      n_(model_->num_velocities()),
      p_(prior_.size()),
      mode_(Eigen::VectorXd::Zero(p_)),
      precision_(Eigen::MatrixXd::Identity(p_, p_)),
      noise_sd_(GuessedNoise(model_->description())),
      scale_(Eigen::VectorXd::Ones(2 * n_)),
      sums_(static_cast<int>(2 * n_), mode_),
      next_sums_(sums_) {}

bool StreamingLaplace::Add(const Transition& transition, int64_t episode) {
  std::vector<size_t> turns = NextInTurn();
  if (rollouts_.empty() || rollouts_.back().episode != episode)
    rollouts_.push_back({episode, 0, {}});
  auto& transitions = rollouts_.back().transitions;
  transitions.push_back(transition);
  Piece piece{rollouts_.size() - 1,
              transitions.size() - 1,
              {},
              !(StartSd(transition).array() == 0).all(),
              -1,
              {},
              {}};
  int unknown = 0;
  for (int c = 0; c < static_cast<int>(2 * n_); ++c) {
    if (!IsObserved(space_, transition, c)) continue;
    piece.coordinates.push_back(c);
    unknown += !(EndSd(transition, c) > 0);
  }
  pieces_.push_back(std::move(piece));
  ++left_out_;
  std::vector<size_t> indices{pieces_.size() - 1};
  indices.insert(indices.end(), turns.begin(), turns.end());
  const auto count_turns = [&] {
    for (const size_t i : turns) {
      if (pieces_[i].at.size() > 0)
        next_sums_.Add(pieces_[i].coordinates, pieces_[i].errors, pieces_[i].at);
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
  uncertain_starts_ += pieces_.back().start_uncertain;
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
    if (piece.coordinates.empty()) continue;
    const bool stale = piece.at.size() == 0 || piece.noise_version != noise_version_;
    if (stale || DistanceFrom(piece.at) > kUnmoved)
      turns.push_back(next_);
    else
      next_sums_.Add(piece.coordinates, piece.errors, piece.at);
  }
  return turns;
}

// Of the mode, in posterior standard deviations.
double StreamingLaplace::DistanceFrom(const Eigen::VectorXd& at) const {
  const Eigen::VectorXd offset = mode_ - at;
  return std::sqrt(offset.dot(precision_ * offset));
}

const Transition& StreamingLaplace::TransitionOf(const Piece& piece) const {
  return rollouts_[piece.rollout].transitions[piece.transition];
}

// States at the windows' ends, 2 n rows for each window; NaN where the simulation fails.
// @param indices of the pieces that they are, each of so many windows one after the other.
Eigen::MatrixXd StreamingLaplace::Predict(const Eigen::MatrixXd& standard,
                                          const std::vector<Window>& windows,
                                          const std::vector<size_t>& indices) {
  const size_t each = windows.size() / std::max<size_t>(1, indices.size());
  const Eigen::MatrixXd physical =
      PhysicalColumns(model_->description(), prior_.FromStandard(standard));
  Eigen::MatrixXd ends(2 * n_ * static_cast<Eigen::Index>(windows.size()), physical.cols());
  windows_.Predict(physical, windows,
                   [&](Eigen::Index sample, size_t window, size_t, const auto& q, const auto& v) {
                     const Eigen::Index first = 2 * n_ * static_cast<Eigen::Index>(window);
                     ends.col(sample).segment(first, n_) = space_.Coordinates(
                         q, NearEnd(TransitionOf(pieces_[indices[window / each]])));
                     ends.col(sample).segment(first + n_, n_) = v;
                   });
  simulated_steps_ += static_cast<int64_t>(windows.size()) * physical.cols();
  return ends;
}

// All at the mode, side by side.
void StreamingLaplace::Linearise(const std::vector<size_t>& indices) {
  std::vector<Window> windows;
  for (const size_t i : indices) {
    const Piece& piece = pieces_[i];
    windows.push_back(RecordedWindow(*model_, rollouts_[piece.rollout], piece.transition, 1));
  }
  Eigen::MatrixXd at = mode_.replicate(1, 1 + p_);
  at.rightCols(p_).diagonal().array() += kSlopeDifference;
  const Eigen::MatrixXd ends = Predict(at, windows, indices);
  const auto sensitivities = StartSensitivities(indices, windows, ends.col(0));
  for (size_t k = 0; k < indices.size(); ++k) {
    Piece& piece = pieces_[indices[k]];
    const Eigen::Index first = 2 * n_ * static_cast<Eigen::Index>(k);
    if (piece.coordinates.empty() || !ends.col(0).segment(first, 2 * n_).allFinite()) continue;
    Eigen::MatrixXd raw(static_cast<Eigen::Index>(piece.coordinates.size()), 1 + p_);
    const Transition& transition = TransitionOf(piece);
    Eigen::VectorXd reading(2 * n_);
    reading << space_.Coordinates(transition.next_q, NearEnd(transition)), transition.next_v;
    for (Eigen::Index i = 0; i < raw.rows(); ++i) {
      const int c = piece.coordinates[static_cast<size_t>(i)];
      raw.row(i) = ends.row(first + c);
      raw.row(i).tail(p_).array() -= raw(i, 0);
      raw(i, 0) -= reading(c);
    }
    for (Eigen::Index j = 1; j <= p_; ++j) {
      if (raw.col(j).allFinite()) continue;
      // Where one step forward is no simulator, one backward has to do.
      const Eigen::MatrixXd back = Predict(
          mode_ - kSlopeDifference * Eigen::VectorXd::Unit(p_, j - 1), {windows[k]}, {indices[k]});
      for (Eigen::Index i = 0; i < raw.rows(); ++i) {
        const int c = piece.coordinates[static_cast<size_t>(i)];
        raw(i, j) = ends(first + c, 0) - back(c, 0);
      }
      if (!raw.col(j).allFinite()) raw.col(j).setZero();  // nothing can be told of it
    }
    raw.rightCols(p_) /= kSlopeDifference;
    Replace(piece, Whiten(piece, raw, sensitivities[k]));
  }
}

// Sensitivities of the ends to the starts, 2 n x 2 n, of those windows whose start is uncertain;
// by finite differences, or that of free motion where they fail.
std::vector<Eigen::MatrixXd> StreamingLaplace::StartSensitivities(
    const std::vector<size_t>& indices, const std::vector<Window>& windows,
    const Eigen::VectorXd& middle) {
  const Eigen::VectorXd differences = StartDifferences(noise_sd_);
  std::vector<Window> moved;
  std::vector<size_t> uncertain, moved_of;
  for (size_t k = 0; k < indices.size(); ++k) {
    if (!pieces_[indices[k]].start_uncertain) continue;
    uncertain.push_back(k);
    moved_of.push_back(indices[k]);
    for (Eigen::Index c = 0; c < 2 * n_; ++c) {
      moved.push_back(windows[k]);
      MoveStart(space_, c, differences(c), &moved.back());
    }
  }
  std::vector<Eigen::MatrixXd> sensitivities(indices.size());
  if (moved.empty()) return sensitivities;
  const Eigen::MatrixXd ends = Predict(mode_, moved, moved_of);
  for (size_t u = 0; u < uncertain.size(); ++u) {
    const size_t k = uncertain[u];
    Eigen::MatrixXd sensitivity = Eigen::MatrixXd::Map(
        ends.data() + 4 * n_ * n_ * static_cast<Eigen::Index>(u), 2 * n_, 2 * n_);
    sensitivity.colwise() -= middle.segment(2 * n_ * static_cast<Eigen::Index>(k), 2 * n_);
    sensitivity = sensitivity * differences.cwiseInverse().asDiagonal();
    if (!sensitivity.allFinite())
      sensitivity = FreeMotion(n_, TransitionOf(pieces_[indices[k]]).duration());
    sensitivities[k] = std::move(sensitivity);
  }
  return sensitivities;
}

// @param raw errors and slopes of what was observed. @param sensitivity of all entries.
Eigen::MatrixXd StreamingLaplace::Whiten(const Piece& piece, Eigen::MatrixXd raw,
                                         const Eigen::MatrixXd& sensitivity) const {
  const Transition& transition = TransitionOf(piece);
  const Eigen::VectorXd recorded = StartSd(transition);
  Eigen::VectorXd end_sd(raw.rows());
  Eigen::MatrixXd observed(sensitivity.size() > 0 ? raw.rows() : 0, sensitivity.cols());
  for (Eigen::Index i = 0; i < raw.rows(); ++i) {
    const int c = piece.coordinates[static_cast<size_t>(i)];
    const double sd = EndSd(transition, c);
    end_sd(i) = sd > 0 ? sd : noise_sd_(c);
    if (observed.rows() > 0) observed.row(i) = sensitivity.row(c);
  }
  const std::array<Eigen::Index, 2> step{0, raw.rows()};
  WhitenWindow(step, recorded.array().isNaN().select(noise_sd_, recorded), observed, end_sd, raw);
  return raw;
}

void StreamingLaplace::Replace(Piece& piece, Eigen::MatrixXd errors) {
  if (piece.at.size() > 0)
    sums_.TakeAway(piece.coordinates, piece.errors, piece.at);
  else
    --left_out_;
  piece.errors = std::move(errors);
  piece.at = mode_;
  piece.noise_version = noise_version_;
  sums_.Add(piece.coordinates, piece.errors, piece.at);
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
      if (piece.at.size() > 0) sums_.Add(piece.coordinates, piece.errors, piece.at);
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
  // dx/du: exact for normal priors.
  const Eigen::VectorXd width = (prior_.FromStandard(mode_.array() + kSlopeDifference) -
                                 prior_.FromStandard(mode_.array() - kSlopeDifference)) /
                                (2 * kSlopeDifference);
  return {prior_.FromStandard(mode_),
          width.asDiagonal() * standard.covariance * width.asDiagonal()};
}

}  // namespace plumb
