#include "trainer/moments.h"

#include <cmath>

namespace plumb {
namespace {

// Relative to its mean: what varies by less is rounding of what never does.
constexpr double kConstant = 1e-6;

}  // namespace

void RunningMoments::Add(double value) {
  count += 1;
  const double offset = value - mean;
  mean += offset / count;
  squares += offset * (value - mean);
}

double RunningMoments::sd() const { return squares > 0 ? std::sqrt(squares / count) : 1; }

void ObservationMoments::Add(const Eigen::Ref<const Eigen::VectorXf>& observation) {
  if (count == 0) mean.setZero(observation.size()), squares.setZero(observation.size());
  count += 1;
  for (Eigen::Index i = 0; i < mean.size(); ++i) {
    const double offset = double{observation[i]} - mean[i];
    mean[i] += offset / count;
    squares[i] += offset * (double{observation[i]} - mean[i]);
  }
}

void ObservationMoments::Merge(const ObservationMoments& other) {
  if (other.count == 0) return;
  if (count == 0) {
    *this = other;
    return;
  }
  const double total = count + other.count;
  const Eigen::VectorXd offset = other.mean - mean;
  squares += other.squares + offset.cwiseAbs2() * (count * other.count / total);
  mean += offset * (other.count / total);
  count = total;
}

Eigen::VectorXd ObservationMoments::sd() const {
  Eigen::VectorXd sd = Eigen::VectorXd::Ones(mean.size());
  for (Eigen::Index i = 0; i < sd.size(); ++i) {
    const double found = std::sqrt(squares[i] / count);
    if (found > kConstant * (1 + std::abs(mean[i]))) sd[i] = found;
  }
  return sd;
}

}  // namespace plumb
