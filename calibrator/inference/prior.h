#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/random.h"

namespace plumb {

/// The prior: independent distributions of n parameters. In *standard* coordinates u =
/// Phi^-1(F(x)), F the prior's distribution function, every prior is a standard normal and no
/// parameter has bounds: methods may work there. Immutable, hence thread-safe.
class Prior {
 public:
  struct Marginal {
    enum class Kind { kNormal, kUniform };
    Kind kind;
    double a, b;  ///< kNormal: mean and standard deviation > 0; kUniform: bounds a < b
  };
  static Marginal Normal(double mean, double sd) { return {Marginal::Kind::kNormal, mean, sd}; }
  static Marginal Uniform(double lower, double upper) {
    return {Marginal::Kind::kUniform, lower, upper};
  }

  /// @throws std::invalid_argument for none, or one that is not a distribution.
  explicit Prior(std::vector<Marginal> marginals);

  Eigen::Index size() const { return static_cast<Eigen::Index>(marginals_.size()); }
  const std::vector<Marginal>& marginals() const { return marginals_; }

  /// Column by column; any number of columns. Beyond a uniform prior's bounds u is infinite.
  Eigen::MatrixXd ToStandard(const Eigen::MatrixXd& x) const;
  Eigen::MatrixXd FromStandard(const Eigen::MatrixXd& u) const;
  /// dx/du at a point u of standard coordinates: exact for normal marginals.
  Eigen::VectorXd Slope(const Eigen::VectorXd& u) const;
  /// Half of what lies between u = -1 and u = 1: the standard deviation of a normal marginal.
  Eigen::VectorXd Width() const;
  /// ln p(x) of one point; -infinity outside of the bounds.
  double LogDensity(const Eigen::VectorXd& x) const;
  /// n x count draws.
  Eigen::MatrixXd Sample(Eigen::Index count, Random& random) const;

 private:
  std::vector<Marginal> marginals_;
};

}  // namespace plumb
