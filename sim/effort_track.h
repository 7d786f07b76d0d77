#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

namespace plumb {

/// An effort that is held for some time.
struct EffortSegment {
  double duration;         ///< [s], >= 0
  Eigen::VectorXd effort;  ///< [Nm or N] per velocity; zero at passive joints
};

/// In how many equal substeps a duration > 0 is divided: of about `substep` seconds, at most a
/// tenth more, so that a recorded step of 8.05 ms has as many of 2 ms as one of 8 ms.
inline double SubstepCount(double duration, double substep) {
  return std::max(1.0, std::ceil(duration / substep - 0.1));
}

/// Efforts as they were commanded over time, piecewise constant, seen through a delay that need not
/// be a whole number of steps: the delayed effort's mean over a substep, and its first moment about
/// the middle, which together move the joints as the steps within it do, to second order. Not
/// thread-safe. Apart from construction nothing allocates.
class EffortTrack {
 public:
  /// @param remembered [s] how far back efforts are known after Advance.
  EffortTrack(int velocities, double remembered);

  /// Forgets everything: before the track, no effort.
  void Clear();
  /// Holds `effort` (one per velocity) for `duration` after what has been appended so far.
  void Append(const double* effort, double duration);
  /// Time 0 moves to the end of the track.
  void Advance();

  struct Moments {
    double mean;   ///< of u over the interval
    double first;  ///< integral of (middle - t) u(t) dt; exactly zero where u is constant
  };
  /// Of the effort of velocity i over [begin, end] minus delay. Beyond the end of the track, its
  /// last effort.
  Moments Over(size_t i, double begin, double end, double delay);

  /// The effort that arrives at time t. @param i velocity.
  double At(size_t i, double t, double delay) { return Over(i, t, t, delay).mean; }

 private:
  size_t n_;
  double remembered_;
  std::vector<double> ends_;     // of each segment, increasing; the first begins at -infinity
  std::vector<double> efforts_;  // n of each
  size_t latest_ = 0;            // segment in which the latest interval began: the next is near
};

}  // namespace plumb
