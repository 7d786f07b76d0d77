// Relative-entropy policy search with the paper's budget: 25 samples, 0.1 nat, 40 updates on 100
// transitions = 1e5 simulations.
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>

#include "calibrator/fit/robot_least_squares.h"
#include "calibrator/inference/reps_search.h"
#include "tests/calibrator/hopper.h"

namespace plumb {
namespace {

struct Accuracy {
  double rms_error = 0;  ///< [kg] of the mean, over masses and seeds
  double rms_sd = 0;     ///< [kg] that the distributions claim
};

class Paper {
 public:
  Paper()
      : robot_(Hopper()),
        truth_(Eigen::Vector4d(3.8, 4.1, 2.9, 5.2)),
        rollouts_(RandomRollouts(robot_, truth_, 100, 1e-5, 5)),
        errors_(std::make_shared<Model>(robot_), rollouts_, 1, 2),
        problem_(ProblemOf(robot_, errors_)) {}

  Accuracy Search(RepsOptions options, int seeds) {
    Accuracy accuracy;
    for (int seed = 1; seed <= seeds; ++seed) {
      options.seed = static_cast<uint64_t>(seed);
      const int64_t before = errors_.simulated_steps();
      const RepsState run = SearchByReps(
          problem_.prior, [&](const Eigen::MatrixXd& x) { return Evaluate(options.returns, x); },
          options, 40);
      REQUIRE(errors_.simulated_steps() - before == 100'000);
      const Eigen::VectorXd mean = robot_.ToPhysical(run.distribution.mean);
      accuracy.rms_error += (mean - truth_).squaredNorm() / (4.0 * seeds);
      accuracy.rms_sd +=
          run.distribution.covariance.diagonal().cwiseProduct(mean.cwiseAbs2()).sum() /
          (4.0 * seeds);
    }
    return {std::sqrt(accuracy.rms_error), std::sqrt(accuracy.rms_sd)};
  }

 private:
  Eigen::VectorXd Evaluate(RepsReturns returns, const Eigen::MatrixXd& x) {
    if (returns == RepsReturns::kLogLikelihood) return LogLikelihood(problem_, x);
    Eigen::MatrixXd physical(x.rows(), x.cols());
    for (Eigen::Index i = 0; i < x.cols(); ++i) physical.col(i) = robot_.ToPhysical(x.col(i));
    // mean |s' - f(s, a)|^2
    return errors_.Raw(physical).colwise().squaredNorm().transpose() / 100;
  }

  RobotDescription robot_;
  Eigen::VectorXd truth_;
  std::vector<Rollout> rollouts_;
  WindowErrors errors_;
  LeastSquares problem_;
};

TEST_CASE("reps finds the hopper's masses within the paper's budget, and knows how well") {
  Paper paper;
  const Accuracy ours = paper.Search({}, 10);
  CAPTURE(ours.rms_error, ours.rms_sd);
  CHECK(ours.rms_error < 0.05);
  CHECK(ours.rms_sd < 2 * ours.rms_error);
  CHECK(ours.rms_sd > ours.rms_error / 2);

  RepsOptions scaled;  // costs mapped to [0, 1]: worse, and far too sure of itself
  scaled.returns = RepsReturns::kUnitRange;
  scaled.min_temperature = 0.01;
  const Accuracy published = paper.Search(scaled, 10);
  CAPTURE(published.rms_error, published.rms_sd);
  CHECK(published.rms_error > 2 * ours.rms_error);
  CHECK(published.rms_sd < published.rms_error / 2);
}

}  // namespace
}  // namespace plumb
