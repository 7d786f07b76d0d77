#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "common/gaussian.h"

namespace plumb {

/// A standard normal distribution of n coordinates (what every prior is in its standard
/// coordinates) truncated to a union of ellipsoids. What is inferred from parameters drawn from it
/// is the same as from the whole prior as long as the region holds the posterior (truncated
/// proposals: Deistler, Goncalves & Macke, "Truncated proposals for scalable and hassle-free
/// simulation-based inference", NeurIPS 2022). Immutable, hence thread-safe.
class TruncatedPrior {
 public:
  /// The region: every component's ellipsoid that holds 1 - `outside` of it.
  /// @throws std::invalid_argument for no components, a covariance that is not positive definite or
  /// 0 < outside < 1 not being so.
  TruncatedPrior(const GaussianMixture& region, double outside);

  bool Contains(const Eigen::VectorXd& u) const { return Multiplicity(u) > 0; }
  /// n x count draws, or none if `tries` candidates a draw were not enough. Candidates are the
  /// prior's draws or, where those too rarely lie in the region, points uniform in the union of
  /// ellipsoids, accepted in proportion to the prior's density (the union as in MultiNest: Feroz,
  /// Hobson & Bridges, MNRAS 398, 2009, sec. 5.2).
  std::optional<Eigen::MatrixXd> Sample(Eigen::Index count, Random& random,
                                        int tries = 2'000) const;

 private:
  int Multiplicity(const Eigen::VectorXd& u) const;  // number of ellipsoids around u
  Eigen::VectorXd Uniform(Random& random) const;     // a point of the union

  // |inverse_root (u - centre)| <= 1 is the ellipsoid; volumes in units of the unit ball's.
  struct Ellipsoid {
    Eigen::VectorXd centre;
    Eigen::MatrixXd root, inverse_root;
    double volume;
  };
  std::vector<Ellipsoid> ellipsoids_;
  double volume_ = 0;         // sum of the ellipsoids'
  double least_squared_ = 0;  // no point of the region has a smaller |u|^2
};

}  // namespace plumb
