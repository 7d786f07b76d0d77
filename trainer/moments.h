#pragma once

#include <Eigen/Core>

namespace plumb {

/// Running mean and variance of a number (Welford, Technometrics 4, 1962), in double. Not
/// thread-safe, like ObservationMoments.
struct RunningMoments {
  double count = 0, mean = 0, squares = 0;

  void Add(double value);
  /// Standard deviation; 1 until there is something to tell.
  double sd() const;
  bool operator==(const RunningMoments&) const = default;
};

/// The same of each entry of an observation.
struct ObservationMoments {
  double count = 0;
  Eigen::VectorXd mean, squares;  ///< sum of squares about the mean; empty until the first

  void Add(const Eigen::Ref<const Eigen::VectorXf>& observation);
  /// Takes in others, in one step (Chan, Golub and LeVeque, 1979). The bits depend on the order of
  /// merging.
  void Merge(const ObservationMoments& other);
  /// Standard deviations; 1 where an entry never varies.
  Eigen::VectorXd sd() const;
};

}  // namespace plumb
