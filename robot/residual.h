#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "common/random.h"

namespace plumb {

/// The change of n velocities in a control step beyond the simulator's, as a function of D inputs
/// (ResidualInputs), learnt from recorded transitions: the discrepancy function of Kennedy and
/// O'Hagan (J. R. Statist. Soc. B 63, 2001), as a Bayesian linear model of M random Fourier
/// features (Rahimi and Recht, NIPS 2007), which is a Gaussian process with a squared exponential
/// kernel, and of the inputs themselves:
///   phi(x) = (1, z / sqrt(D), sqrt(2 / M) cos(F z + b)),   z = (x - mean) / scale,
///   dv = W phi(x) + L e,   e ~ N(0, 1).
/// z is kept within what was recorded, and W phi within `bound`: where nothing is known nothing
/// grows. Immutable use is thread-safe.
struct ResidualFunction {
  Eigen::VectorXd mean, scale;  ///< D, of the inputs; scale > 0
  Eigen::VectorXd low, high;    ///< D, least and greatest z recorded
  Eigen::MatrixXd frequencies;  ///< M x D
  Eigen::VectorXd phases;       ///< M [rad]
  /// W of each draw, n x (1 + D + M) [rad/s or m/s]
  std::vector<Eigen::MatrixXd> weights;
  Eigen::MatrixXd noise;  ///< n x n, L: what is left, and is not the readings' [rad/s or m/s]
  Eigen::VectorXd bound;  ///< n, > 0 [rad/s or m/s]

  Eigen::Index inputs() const { return mean.size(); }
  Eigen::Index outputs() const { return noise.rows(); }
  Eigen::Index features() const { return 1 + mean.size() + phases.size(); }
  /// Writes phi(x). Does not allocate.
  void Features(const Eigen::Ref<const Eigen::VectorXd>& x,
                Eigen::Ref<Eigen::VectorXd> features) const;
};

/// What a simulator lacks, for some draws of its parameters: each of them has its own function, as
/// what is lacking depends on what the parameters explain. Of steps that touch the ground or a stop
/// and of free ones apart: contact is what simulators have wrong most, and its errors must not be
/// smeared over the rest. Where there is no function, the simulator is right as it is. Immutable
/// use is thread-safe.
struct Residual {
  std::vector<Eigen::VectorXd> coordinates;  ///< of the parameters, of each draw; at least one
  std::optional<ResidualFunction> free, touching;
  /// [m], [rad] as near to the ground or a stop as this is touching: states are not known better
  double margin = kTouchMargin;

  static constexpr double kTouchMargin = 0.0078125;  // 2^-7: the same in single precision
};

/// @throws std::invalid_argument naming the field that is not finite, or not positive where it has
/// to be. Thread-safe.
void RequireFinite(const Residual& residual);

/// A residual as one episode has it. Not thread-safe; does not allocate after construction.
class ResidualSample {
 public:
  /// @param residual must outlive this.
  explicit ResidualSample(const Residual& residual);

  /// Begins an episode. @param draw < residual.coordinates.size(). @param random for its noise.
  void Begin(size_t draw, Random& random);
  /// Change of the velocities in a control step, n entries [rad/s or m/s]; zero where there is no
  /// function. @param x see ResidualInputs. Valid until the next call.
  const Eigen::VectorXd& Step(bool touching, const Eigen::Ref<const Eigen::VectorXd>& x);

 private:
  const Residual* residual_;
  size_t draw_ = 0;
  Random random_{0};
  Eigen::VectorXd free_features_, touching_features_, normal_, change_;
};

}  // namespace plumb
