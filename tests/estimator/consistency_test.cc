// Where motion and readings are as the filter has them, it knows how far off it is: the normalised
// estimation error squared (Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking
// and Navigation", 2001, section 5.4.2) of independent runs is chi-square, causal and smoothed.

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "common/decompositions.h"
#include "common/random.h"
#include "estimator/kinematic_filter.h"

namespace plumb {
namespace {

constexpr int kRuns = 10'000, kSteps = 60, kPerAcceleration = 3;
constexpr double kDt = 0.002;

EstimatorSettings Settings() {
  EstimatorSettings settings{};
  settings.position_sd = 1e-4;
  settings.velocity_sd = 0.1;
  settings.acceleration_sd = 0.3;
  settings.jerk = 200;
  settings.effort_step = 2;
  settings.lag = 20;
  settings.bias_sd = 0.1;
  return settings;
}

double Nees(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance) {
  return error.dot(covariance.ldlt().solve(error));
}

// Position, velocity and acceleration under white jerk (section 6.2.3) and steps of the
// acceleration.
class DriftingMotion {
 public:
  DriftingMotion(const EstimatorSettings& settings, Random& random)
      : settings_(settings), random_(random) {
    Eigen::Matrix3d q;
    q << std::pow(kDt, 5) / 20, std::pow(kDt, 4) / 8, std::pow(kDt, 3) / 6,  //
        std::pow(kDt, 4) / 8, std::pow(kDt, 3) / 3, std::pow(kDt, 2) / 2,    //
        std::pow(kDt, 3) / 6, std::pow(kDt, 2) / 2, kDt;
    root_ = settings.jerk * q.llt().matrixL().toDenseMatrix();
    state_ << 0.3, random.Normal(), 5 * random.Normal();
  }
  void Advance(double effort_step) {
    state_(2) += settings_.effort_step * effort_step * random_.Normal();
    Eigen::Matrix3d transition;
    transition << 1, kDt, kDt * kDt / 2, 0, 1, kDt, 0, 0, 1;
    const Eigen::Vector3d noise(random_.Normal(), random_.Normal(), random_.Normal());
    state_ = transition * state_ + root_ * noise;
  }
  const Eigen::Vector3d& state() const { return state_; }

 private:
  EstimatorSettings settings_;
  Random& random_;
  Eigen::Matrix3d root_;
  Eigen::Vector3d state_;
};

TEST_CASE(
    "errors are as large as the covariances say: NEES within the 95 % band of independent runs") {
  const EstimatorSettings settings = Settings();
  const bool accelerometer = GENERATE(false, true);
  double causal = 0, smoothed = 0;
  for (uint32_t run = 0; run < kRuns; ++run) {
    Random random(5, {run, accelerometer});
    DriftingMotion motion(settings, random);
    KinematicFilter filter(settings);
    const double bias = settings.bias_sd * random.Normal();
    std::vector<Eigen::Vector3d> truth{motion.state()};
    filter.Restart(motion.state()(0) + settings.position_sd * random.Normal(),
                   motion.state()(1) + settings.velocity_sd * random.Normal());
    double marked = 0;
    for (int i = 0; i < kSteps; ++i) {
      const double effort_step = i % 4 == 0 ? 3 : 0;
      motion.Advance(effort_step);
      truth.push_back(motion.state());
      filter.Predict(kDt, effort_step);
      filter.Correct(Quantity::kPosition,
                     motion.state()(0) + settings.position_sd * random.Normal(), 0);
      filter.Correct(Quantity::kVelocity,
                     motion.state()(1) + settings.velocity_sd * random.Normal(), 0);
      if (accelerometer && i % kPerAcceleration == 0) {
        if (i > 0) {
          const double mean = (motion.state()(1) - marked) / (kPerAcceleration * kDt);
          filter.Correct(Quantity::kAcceleration,
                         mean + bias + settings.acceleration_sd * random.Normal(), 0);
        }
        marked = motion.state()(1);
        filter.Mark(0);
      }
      filter.Keep();
      if (filter.pending() > settings.lag + 1) filter.TakeOldest();
    }
    const auto at = truth.size() - static_cast<size_t>(filter.pending());
    const KinematicFilter::Smoothed oldest = filter.TakeOldest();
    smoothed += Nees(truth[at].head<2>() - oldest.mean, oldest.covariance);
    causal +=
        Nees(motion.state() - filter.mean().head<3>(), filter.covariance().topLeftCorner<3, 3>());
  }
  // Chi-square of so many degrees is normal to a part in a hundred; 95 % of it is within 1.96 sd.
  INFO("causal " << causal / (3 * kRuns) << ", smoothed " << smoothed / (2 * kRuns));
  CHECK(std::abs(causal - 3 * kRuns) < 1.96 * std::sqrt(2 * 3 * kRuns));
  CHECK(std::abs(smoothed - 2 * kRuns) < 1.96 * std::sqrt(2 * 2 * kRuns));
}

}  // namespace
}  // namespace plumb
