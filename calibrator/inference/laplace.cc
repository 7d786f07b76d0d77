#include "calibrator/inference/laplace.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "calibrator/inference/noise.h"
#include "calibrator/inference/sandwich.h"
#include "calibrator/inference/slopes.h"
#include "common/decompositions.h"

namespace plumb {
namespace {

constexpr double kDifference = kSlopeDifference;
// Of the best-known direction's information in the least known one: below, forward differences will
// not do, or rounding has made it.
constexpr double kLopsided = 1e-6, kRounding = 1e-15;
// No step leads further than that many of the prior's standard deviations.
constexpr double kLongestStep = 2;
// Within that many posterior standard deviations the slope changes little.
constexpr double kNear = 10;
// Times the tolerance: where so short a step is a good one by its slope and yet a bad one, the
// errors jump (a contact that is made or not). To creep up to the edge gains 0.02 nat at most.
constexpr double kRough = 10;

class Fit {
 public:
  Fit(const LeastSquares& problem, const LaplaceOptions& options)
      : problem_(problem),
        options_(options),
        n_(problem.prior.size()),
        noise_(problem.group, problem.block, problem.scale_known) {}

  LaplaceFit Run(const Eigen::VectorXd& start) {
    u_ = problem_.prior.ToStandard(start);
    if (!u_.allFinite())
      throw std::invalid_argument("the fit begins on or beyond a bound of the prior");
    errors_ = Evaluate(u_);
    const auto rows = static_cast<Eigen::Index>(problem_.group.size());
    if (errors_.rows() != rows)
      throw std::invalid_argument("errors, groups, blocks and clusters must be equally many");
    if (!errors_.allFinite())
      throw std::invalid_argument(
          "the simulation fails with the parameters that the fit begins with");
    if (!problem_.scale_known && rows < n_ + 3) {
      throw std::invalid_argument("only " + std::to_string(rows) +
                                  " numbers were observed: too few to tell noise from " +
                                  std::to_string(n_) + " parameters");
    }
    noise_.Estimate(errors_, 0);
    Climb();
    if (options_.robust && noise_.ChooseTails(errors_, EffectiveParameters())) Climb();
    if (options_.jacobian_at_end) {
      if (!fresh_) Differentiate();
      Symmetrise();
    }
    return Result();
  }

 private:
  Eigen::MatrixXd Evaluate(const Eigen::MatrixXd& u) {
    simulations_ += u.cols();
    return problem_.errors(problem_.prior.FromStandard(u));
  }

  void Differentiate() {
    jacobian_ =
        Slopes([&](const Eigen::MatrixXd& u) { return Evaluate(u); }, u_, errors_, problem_.block);
    fresh_ = near_ = true;
  }

  // Forward differences err by the curvature, relative to the slope by about kDifference. Where
  // some directions are known much less well than others this would pass for knowledge; central
  // differences err by its square only.
  void Symmetrise() {
    const Eigen::VectorXd values =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Curvature(), Eigen::EigenvaluesOnly)
            .eigenvalues();
    if (values(0) > kLopsided * values(n_ - 1)) return;
    jacobian_ = CentralSlopes([&](const Eigen::MatrixXd& u) { return Evaluate(u); }, u_, errors_,
                              problem_.block, jacobian_);
  }

  // Information that is no more than rounding is none.
  static Eigen::MatrixXd WithoutRounding(const Eigen::MatrixXd& information) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(information);
    const Eigen::ArrayXd values = eigen.eigenvalues().array();
    const Eigen::VectorXd kept = (values > kRounding * values.maxCoeff()).select(values, 0.0);
    return eigen.eigenvectors() * kept.asDiagonal() * eigen.eigenvectors().transpose();
  }

  double EffectiveParameters() const {
    const Eigen::MatrixXd h = Curvature();
    return Eigen::MatrixXd(h + Eigen::MatrixXd::Identity(n_, n_)).llt().solve(h).trace();
  }
  Eigen::MatrixXd Curvature() const { return noise_.Information(jacobian_); }

  // -ln posterior, noise scale maximised.
  double Cost(const Eigen::VectorXd& errors, const Eigen::VectorXd& u, double effective) {
    Noise noise = noise_;
    noise.Estimate(errors, effective);
    return 0.5 * u.squaredNorm() - noise.LogLikelihood(errors);
  }

  void Climb() {
    double damping = 0;
    converged_ = false;
    if (!near_) Differentiate();  // even if there is no iteration
    for (int iteration = 0; iteration < options_.max_iterations && !converged_; ++iteration) {
      if (!near_) Differentiate();
      const double effective = EffectiveParameters();
      noise_.Estimate(errors_, effective);
      const Eigen::VectorXd weights = noise_.Weights(errors_);
      const Eigen::MatrixXd curvature = jacobian_.transpose() * weights.asDiagonal() * jacobian_ +
                                        Eigen::MatrixXd::Identity(n_, n_);
      const Eigen::VectorXd slope = jacobian_.transpose() * weights.cwiseProduct(errors_) + u_;
      const double cost = Cost(errors_, u_, effective);
      for (;;) {
        Eigen::MatrixXd damped = curvature;
        damped.diagonal() *= 1 + damping;
        Eigen::VectorXd step = -damped.llt().solve(slope);
        const double longest = step.cwiseAbs().maxCoeff();
        if (longest > kLongestStep) step *= kLongestStep / longest;
        const double in_sds = std::sqrt(step.dot(curvature * step));
        if (!(longest > 1e-13)) {
          converged_ = true;
          break;
        }
        const Eigen::VectorXd u = u_ + step;
        const Eigen::VectorXd errors = Evaluate(u);
        if (errors.allFinite() && Cost(errors, u, effective) <= cost) {
          // Broyden's update: what a short step has taught of the slope is enough for the next one.
          jacobian_ +=
              (errors - errors_ - jacobian_ * step) * step.transpose() / step.squaredNorm();
          u_ = u, errors_ = errors, fresh_ = false;
          near_ = in_sds < kNear;
          damping = damping > 1e-3 ? damping / 10 : 0;
          converged_ = in_sds < options_.tolerance;
          break;
        }
        // A step that is too short to matter, or that rounding makes no better.
        if (in_sds < (fresh_ ? kRough : 1) * options_.tolerance || damping > 1e12) {
          converged_ = true;
          break;
        }
        if (!fresh_) {  // perhaps the slope is to blame
          Differentiate();
          break;
        }
        damping = std::max(10 * damping, 1e-2);
      }
    }
    noise_.Estimate(errors_, EffectiveParameters());
  }

  LaplaceFit Result() const {
    LaplaceFit fit;
    fit.mode = problem_.prior.FromStandard(u_);
    const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(n_, n_);
    const Eigen::MatrixXd information = WithoutRounding(noise_.Information(jacobian_));
    Eigen::MatrixXd widened = information;
    if (options_.sandwich) {
      const Eigen::VectorXd weighted = noise_.Weights(errors_).cwiseProduct(errors_);
      const Sandwich wider =
          WidenBySandwich(information, weighted.asDiagonal() * jacobian_, problem_.cluster);
      widened = wider.information, fit.inflation = wider.inflation;
    }
    fit.standard = {u_, Eigen::MatrixXd(widened + identity).llt().solve(identity)};
    fit.standard.covariance =
        (fit.standard.covariance + fit.standard.covariance.transpose()).eval() / 2;
    const Eigen::VectorXd width = problem_.prior.Slope(u_);
    fit.posterior = {fit.mode, width.asDiagonal() * fit.standard.covariance * width.asDiagonal()};
    const Eigen::VectorXd narrow = width.cwiseInverse();
    fit.information = narrow.asDiagonal() * information * narrow.asDiagonal();
    fit.scale = noise_.scale();
    const Eigen::VectorXd divisor = noise_.RowScale();
    fit.errors = errors_.cwiseQuotient(divisor);
    fit.jacobian = divisor.cwiseInverse().asDiagonal() * jacobian_ * narrow.asDiagonal();
    fit.degrees_of_freedom = noise_.degrees_of_freedom();
    fit.log_posterior = noise_.LogLikelihood(errors_) - 0.5 * u_.squaredNorm();
    fit.simulations = simulations_;
    fit.converged = converged_;
    return fit;
  }

  const LeastSquares& problem_;
  const LaplaceOptions& options_;
  Eigen::Index n_;
  Noise noise_;
  Eigen::VectorXd u_, errors_;
  Eigen::MatrixXd jacobian_;
  bool fresh_ = false;  // the Jacobian is that of u_
  bool near_ = false;   // or of a point not far from it
  bool converged_ = false;
  int64_t simulations_ = 0;
};

}  // namespace

LaplaceFit FitLaplace(const LeastSquares& problem, const Eigen::VectorXd& start,
                      const LaplaceOptions& options) {
  if (start.size() != problem.prior.size())
    throw std::invalid_argument("the start has another number of parameters than the prior");
  if (problem.block.size() != problem.group.size() ||
      problem.cluster.size() != problem.group.size()) {
    throw std::invalid_argument("errors, groups, blocks and clusters must be equally many");
  }
  return Fit(problem, options).Run(start);
}

Eigen::VectorXd LogLikelihood(const LeastSquares& problem, const Eigen::MatrixXd& parameters,
                              double degrees_of_freedom) {
  const Eigen::MatrixXd errors = problem.errors(parameters);
  Noise noise(problem.group, problem.block, problem.scale_known, degrees_of_freedom);
  Eigen::VectorXd values(errors.cols());
  for (Eigen::Index i = 0; i < errors.cols(); ++i) {
    if (!errors.col(i).allFinite()) {
      values(i) = -std::numeric_limits<double>::infinity();
      continue;
    }
    noise.Estimate(errors.col(i), 0);
    values(i) = noise.LogLikelihood(errors.col(i));
  }
  return values;
}

Eigen::MatrixXd Draw(const LaplaceFit& fit, const Prior& prior, Eigen::Index count,
                     Random& random) {
  return prior.FromStandard(Transform(fit.standard, StandardNormals(prior.size(), count, random)));
}

}  // namespace plumb
