#include "experiments/population_weights.h"

#include <cmath>
#include <stdexcept>

namespace plumb {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

// Mean distances of the predictions from the outcomes, and from each other.
struct Quadratic {
  VectorXd a;
  MatrixXd k;
};

Quadratic MeanDistances(const std::vector<MatrixXd>& predictions, const MatrixXd& outcomes,
                        const std::vector<Index>& simulators) {
  const auto count = static_cast<Index>(simulators.size());
  Quadratic mean{VectorXd::Zero(count), MatrixXd::Zero(count, count)};
  for (size_t t = 0; t < predictions.size(); ++t) {
    const MatrixXd x = predictions[t](Eigen::all, simulators);
    mean.a += (x.colwise() - outcomes.col(static_cast<Index>(t))).colwise().norm().transpose();
    for (Index n = 0; n < count; ++n)
      mean.k.col(n) += (x.colwise() - x.col(n)).colwise().norm().transpose();
  }
  mean.a /= static_cast<double>(predictions.size());
  mean.k /= static_cast<double>(predictions.size());
  return mean;
}

// The simulators that have not failed.
std::vector<Index> FiniteOnes(const std::vector<MatrixXd>& predictions, const MatrixXd& outcomes) {
  if (predictions.empty() || static_cast<Index>(predictions.size()) != outcomes.cols() ||
      !outcomes.allFinite()) {
    throw std::invalid_argument(
        "a population needs a finite outcome for every transition, and one at least");
  }
  const Index count = predictions[0].cols();
  std::vector<Index> simulators;
  for (Index n = 0; n < count; ++n) {
    bool finite = true;
    for (const MatrixXd& x : predictions) {
      if (x.cols() != count || x.rows() != outcomes.rows())
        throw std::invalid_argument("predictions differ in size");
      finite = finite && x.col(n).allFinite();
    }
    if (finite) simulators.push_back(n);
  }
  if (simulators.empty()) throw std::invalid_argument("every simulator failed");
  return simulators;
}

}  // namespace

PopulationWeights FitPopulation(const std::vector<MatrixXd>& predictions, const MatrixXd& outcomes,
                                double tolerance) {
  const std::vector<Index> simulators = FiniteOnes(predictions, outcomes);
  const Quadratic f = MeanDistances(predictions, outcomes, simulators);
  Index from, to;
  f.a.minCoeff(&to);
  VectorXd w = VectorXd::Zero(f.a.size());
  w(to) = 1;
  VectorXd gradient = f.a - f.k * w;
  double gap = 0;
  const Index most = 1000 + 200 * f.a.size();
  for (Index step = 0; step < most; ++step) {
    gap = gradient.dot(w) - gradient.minCoeff(&to);
    if (gap <= tolerance * f.k.mean()) break;
    from = -1;
    for (Index n = 0; n < w.size(); ++n) {
      if (w(n) > 0 && (from < 0 || gradient(n) > gradient(from))) from = n;
    }
    // Along e_to - e_from the score's second derivative is 2 K_to,from.
    const double slope = gradient(to) - gradient(from), curvature = 2 * f.k(to, from);
    const double length = curvature > 0 ? std::min(w(from), -slope / curvature) : w(from);
    w(to) += length;
    w(from) = length == w(from) ? 0 : w(from) - length;
    gradient -= length * (f.k.col(to) - f.k.col(from));
  }
  const Index count = predictions[0].cols();
  PopulationWeights result{VectorXd::Zero(count), f.a.dot(w) - 0.5 * w.dot(f.k * w), gap,
                           static_cast<int>(count - f.a.size())};
  result.weights(simulators) = w / w.sum();
  return result;
}

}  // namespace plumb
