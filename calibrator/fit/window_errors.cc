#include "calibrator/fit/window_errors.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "calibrator/fit/recorded_window.h"
#include "calibrator/fit/whitening.h"
#include "common/hash.h"
#include "common/special_numbers.h"
#include "sim/tasks/task.h"

namespace plumb {
namespace {

// Relative to the units of the state; large against the rounding of a simulation, small against its
// curvature.
constexpr double kDifference = 1e-6;

constexpr double kGuess = 1e-3;  // relative to the units of the state

}  // namespace

Eigen::VectorXd GuessedNoise(const RobotDescription& robot) {
  return kGuess * MakeTask(robot)->state_scale();
}

Eigen::VectorXd StartDifferences(const Eigen::VectorXd& noise_sd) {
  return kDifference * (noise_sd / kGuess).cwiseMax(1.0);
}

WindowErrors::WindowErrors(std::shared_ptr<const Model> model, std::span<const Rollout> rollouts,
                           int horizon, ExecutionOptions execution, int every)
    : n_(model->num_velocities()),
      rollouts_(rollouts),
      simulate_(std::move(model), execution.threads),
      space_(simulate_.model().description()),
      looks_for_starts_(ShortestWindow(rollouts) > 1),
      batches_(execution.batches) {
  scale_ = MakeTask(simulate_.model().description())->state_scale();
  noise_sd_ = GuessedNoise(simulate_.model().description());
  const auto longest = static_cast<size_t>(std::max(1, horizon));
  size_t count = 0;
  for (size_t r = 0; r < rollouts.size(); ++r) {
    for (size_t begin = 0; begin < rollouts[r].transitions.size();) {
      size_t left = StretchLength(rollouts[r], begin);
      for (; left > 0; ++count) {
        const size_t length = std::min(left, longest);
        if (count % static_cast<size_t>(every) == 0) AddWindow(r, begin, length);
        begin += length;
        left -= length;
      }
    }
  }
  first_row_.push_back(static_cast<Eigen::Index>(readings_.size()));
  if (rows_.empty()) throw std::invalid_argument("there is no transition whose end was observed");
  identity_ = Hash(readings_.data(), readings_.size() * sizeof(Row));
}

void WindowErrors::AddWindow(size_t rollout, size_t first, size_t length) {
  const auto& transitions = rollouts_[rollout].transitions;
  const Transition& begins = transitions[first];
  const size_t before = readings_.size(), telling = telling_.size();
  std::vector<Eigen::Index> step_rows;
  for (size_t i = first; i < first + length; ++i) {
    step_rows.push_back(static_cast<Eigen::Index>(readings_.size()));
    for (Eigen::Index c = 0; c < 2 * n_; ++c) {
      if (!IsObserved(space_, transitions[i], c)) continue;
      // It takes one position to tell with which velocity the window began.
      const bool tells = i > first || c >= n_ || !IsUnread(begins, c);
      if (tells) telling_.push_back(static_cast<Eigen::Index>(readings_.size()));
      readings_.push_back({static_cast<int>(windows_.size()), static_cast<int>(rollout),
                           static_cast<int>(i), static_cast<int>(c)});
    }
  }
  if (telling_.size() == telling) {
    readings_.resize(before);
    return;
  }
  for (size_t k = telling; k < telling_.size(); ++k)
    rows_.push_back(readings_[static_cast<size_t>(telling_[k])]);
  step_rows.push_back(static_cast<Eigen::Index>(readings_.size()));
  step_rows_.push_back(std::move(step_rows));
  first_row_.push_back(static_cast<Eigen::Index>(before));
  windows_.push_back(RecordedWindow(simulate_.model(), rollouts_[rollout], first, length));
  starts_.push_back({StartSd(begins), {}, {}});
  steps_ += static_cast<int64_t>(length);
}

void WindowErrors::set_noise_sd(const Eigen::VectorXd& sd) {
  if (sd.size() != 2 * n_ || !(sd.minCoeff() > 0) || !sd.allFinite()) {
    throw std::invalid_argument("noise needs a standard deviation > 0 for each entry of (q, v)");
  }
  noise_sd_ = sd;
}

const Transition& WindowErrors::TransitionOf(const Row& row) const {
  return rollouts_[static_cast<size_t>(row.rollout)]
      .transitions[static_cast<size_t>(row.transition)];
}

double WindowErrors::NoiseOf(const Row& row) const {
  return EndSd(TransitionOf(row), row.coordinate, noise_sd_);
}

Eigen::VectorXd WindowErrors::EndNoise() const {
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(2 * n_), count = squares;
  for (const Row& row : readings_)
    squares(row.coordinate) += std::pow(NoiseOf(row), 2), count(row.coordinate) += 1;
  return (count.array() > 0)
      .select((squares.array() / count.array().max(1)).sqrt(), noise_sd_.array());
}

bool WindowErrors::noise_known() const {
  return std::all_of(readings_.begin(), readings_.end(),
                     [&](const Row& row) { return EndSd(TransitionOf(row), row.coordinate) > 0; });
}

bool WindowErrors::starts_known() const {
  return std::all_of(starts_.begin(), starts_.end(),
                     [](const Start& start) { return (start.sd.array() == 0).all(); });
}

Eigen::MatrixXd WindowErrors::Simulate(const Eigen::MatrixXd& physical,
                                       std::span<const Window> windows) {
  Eigen::MatrixXd errors(static_cast<Eigen::Index>(readings_.size()), physical.cols());
  simulate_.Predict(
      physical, windows,
      [&](Eigen::Index sample, size_t window, size_t step, const auto& q, const auto& v) {
        const auto& step_rows = step_rows_[window];
        for (Eigen::Index i = step_rows[step]; i < step_rows[step + 1]; ++i) {
          const Row& row = readings_[static_cast<size_t>(i)];
          errors(i, sample) = EndError(space_, q, v, TransitionOf(row), row.coordinate);
        }
      },
      /*last_only=*/false);
  return errors;
}

// @param which initial states: 0 = the recorded ones.
Eigen::MatrixXd WindowErrors::Predict(const Eigen::MatrixXd& physical,
                                      std::span<const Window> windows, uint64_t which) {
  const auto compute = [&](Eigen::Index first, Eigen::Index count) {
    return Simulate(physical.middleCols(first, count), windows);
  };
  BatchRunner here;
  Eigen::MatrixXd errors =
      (batches_ ? *batches_ : here)
          .Run(Hash(physical, Hash(&which, sizeof which, identity_)),
               static_cast<Eigen::Index>(readings_.size()), physical.cols(), compute);
  simulated_steps_ += steps_ * physical.cols();
  for (Eigen::Index j = 0; j < errors.cols(); ++j) {
    if (errors.col(j).allFinite()) continue;
    for (size_t w = 0; w < windows_.size(); ++w) {
      failures_ +=
          !errors.col(j).segment(first_row_[w], first_row_[w + 1] - first_row_[w]).allFinite();
    }
  }
  return errors;
}

Eigen::MatrixXd WindowErrors::FromRecord(const Eigen::MatrixXd& physical) {
  Eigen::MatrixXd errors = Predict(physical, windows_);
  for (size_t w = 0; w < windows_.size(); ++w) {
    const Start& start = starts_[w];
    if (start.offset.size() == 0) continue;
    const Eigen::VectorXd moved = start.sensitivity * start.offset;
    errors.middleRows(first_row_[w], moved.size()).colwise() -= moved;
  }
  return errors;
}

Eigen::MatrixXd WindowErrors::Telling(const Eigen::MatrixXd& errors) const {
  if (telling_.size() == readings_.size()) return errors;
  return errors(telling_, Eigen::all);
}

Eigen::MatrixXd WindowErrors::Raw(const Eigen::MatrixXd& physical) {
  return Telling(FromRecord(physical));
}

Eigen::VectorXd WindowErrors::StartSdOf(const Start& start) const {
  return start.sd.array().isNaN().select(noise_sd_, start.sd);
}

Eigen::MatrixXd WindowErrors::Whitened(const Eigen::MatrixXd& physical) {
  Eigen::MatrixXd errors = FromRecord(physical);
  for (size_t w = 0; w < windows_.size(); ++w) WhitenWindow(w, &errors);
  for (Eigen::Index j = 0; j < errors.cols(); ++j) {
    if (!errors.col(j).allFinite()) errors.col(j).setConstant(kNaN);
  }
  return Telling(errors);
}

double WindowErrors::LogSpread() const {
  Eigen::MatrixXd none = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(readings_.size()), 1);
  double sum = 0;
  for (size_t w = 0; w < windows_.size(); ++w) sum += WhitenWindow(w, &none);
  return sum;
}

// @return ln det of what the errors were divided by.
double WindowErrors::WhitenWindow(size_t w, Eigen::MatrixXd* errors) const {
  const auto& steps = step_rows_[w];
  const Eigen::Index first = steps.front(), count = steps.back() - first;
  const Start& start = starts_[w];
  Eigen::VectorXd end_sd(count);
  std::vector<int> coordinates;
  for (Eigen::Index i = 0; i < count; ++i) {
    const Row& row = readings_[static_cast<size_t>(first + i)];
    end_sd(i) = NoiseOf(row);
    coordinates.push_back(row.coordinate);
  }
  Eigen::VectorXd start_sd = StartSdOf(start);
  const Transition& begins = TransitionOf(readings_[static_cast<size_t>(first)]);
  if (begins.disturbance.cols() == 0)
    return plumb::WhitenWindow(steps, start_sd, start.sensitivity, end_sd,
                               errors->middleRows(first, count));
  if (start.sensitivity.size() == 0) start_sd.resize(0);  // exact
  Eigen::MatrixXd sensitivity = start.sensitivity;
  AddDisturbance(begins, coordinates, &start_sd, &sensitivity);
  return plumb::WhitenWindow(steps, start_sd, sensitivity, end_sd,
                             errors->middleRows(first, count));
}

}  // namespace plumb
