#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "sim/effort_track.h"
#include "sim/model.h"

namespace plumb {

/// A piece of a recorded motion: a state, and the efforts from there on, to which it refers: they
/// must outlive it. A value.
struct Window {
  Eigen::VectorXd q, v;  ///< readings with which it begins; finite
  /// Control step by control step, at least one; efforts of num_velocities entries, of positive
  /// duration together.
  std::vector<std::span<const EffortSegment>> steps;
  /// The efforts commanded before, the latest last: where efforts are delayed, some of them are
  /// still to act. Before the first of them there was no effort.
  std::vector<std::span<const EffortSegment>> before = {};
};

/// Predicts windows with simulators of many parameters: f_xi over n steps, the inner loop of
/// inference. Windows are simulated side by side in the lanes of an engine and by several threads,
/// each with a fixed share of them, so that results have the same bits for any number of threads,
/// lanes and companions. Not thread-safe itself.
class Windows {
 public:
  /// @param threads fewer than one count as one.
  Windows(std::shared_ptr<const Model> model, int threads);
  Windows(Windows&&) noexcept;
  ~Windows();

  /// Told of the readings at the end of each control step, in their order for each sample and
  /// window; from several threads at once, but never of the same sample and window. Where the
  /// simulation has failed all entries are NaN.
  using Visit = std::function<void(Eigen::Index sample, size_t window, size_t step,
                                   const Eigen::VectorXd& q, const Eigen::VectorXd& v)>;
  /// Simulations, not steps.
  struct Failures {
    int64_t impossible = 0;  ///< there is no simulator with these parameters
    int64_t diverged = 0;    ///< not finite, or beyond kFarthest
    int64_t total() const { return impossible + diverged; }
  };

  /// @param parameters one column per sample, physical units. @param last_only visit the end of
  /// each window only.
  /// @throws std::invalid_argument if a window is not as it should be, or a column not of the
  /// model's parameters; and any exception of a visit, when all threads have ended.
  Failures Predict(const Eigen::MatrixXd& parameters, std::span<const Window> windows,
                   const Visit& visit, bool last_only = true);

  const Model& model() const { return *model_; }

 private:
  struct Worker;

  std::shared_ptr<const Model> model_;
  std::vector<std::unique_ptr<Worker>> workers_;
};

}  // namespace plumb
