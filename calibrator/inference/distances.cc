#include "calibrator/inference/distances.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/decompositions.h"
#include "common/gaussian.h"
#include "common/median.h"
#include "common/special_numbers.h"

namespace plumb {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

// Sum over all pairs of columns of f(squared distance).
template <typename F>
double SumOverPairs(const MatrixXd& x, const MatrixXd& y, const F& f) {
  double sum = 0;
  for (Index j = 0; j < y.cols(); ++j) {
    for (Index i = 0; i < x.cols(); ++i) sum += f((x.col(i) - y.col(j)).squaredNorm());
  }
  return sum;
}

double MeanDistance(const MatrixXd& x, const MatrixXd& y) {
  const double sum = SumOverPairs(x, y, [](double squared) { return std::sqrt(squared); });
  return sum / static_cast<double>(x.cols()) / static_cast<double>(y.cols());
}

double MedianDistance(const MatrixXd& x) {
  // Of at most this many columns, spread evenly: the median of a bandwidth needs no more.
  constexpr Index kMost = 500;
  const Index stride = (x.cols() + kMost - 1) / kMost;
  std::vector<double> distances;
  for (Index i = 0; i < x.cols(); i += stride) {
    for (Index j = 0; j < i; j += stride) distances.push_back((x.col(i) - x.col(j)).norm());
  }
  const double median = Median(std::move(distances));
  return median > 0 ? median : 1;
}

// Integral of the squared difference of two samples' quantile functions.
double Wasserstein(VectorXd x, VectorXd y) {
  std::sort(x.begin(), x.end());
  std::sort(y.begin(), y.end());
  const double per_x = 1 / static_cast<double>(x.size()), per_y = 1 / static_cast<double>(y.size());
  double integral = 0, from = 0;
  for (Index i = 0, j = 0; i < x.size() && j < y.size();) {
    const double x_ends = static_cast<double>(i + 1) * per_x,
                 y_ends = static_cast<double>(j + 1) * per_y;
    const double to = std::min(x_ends, y_ends), difference = x(i) - y(j);
    integral += (to - from) * difference * difference;
    from = to;
    // Equal ends of unequal fractions may differ by rounding; the sliver then left weighs nothing.
    if (x_ends <= to) ++i;
    if (y_ends <= to) ++j;
  }
  return integral;
}

struct Whitening {
  VectorXd mean;
  Eigen::LLT<MatrixXd> root;
  MatrixXd operator()(const MatrixXd& x) const { return root.matrixL().solve(x.colwise() - mean); }
};

Whitening MakeWhitening(const MatrixXd& recorded) {
  Whitening whitening{recorded.rowwise().mean(), {}};
  const MatrixXd centred = recorded.colwise() - whitening.mean;
  MatrixXd covariance = centred * centred.transpose() / static_cast<double>(recorded.cols());
  // A statistic that never varied has no scale of its own: it stays, nearly, in the units it comes
  // in.
  const double largest = covariance.diagonal().maxCoeff();
  covariance.diagonal().array() += largest > 0 ? 1e-6 * largest : 1.;
  whitening.root.compute(covariance);
  return whitening;
}

}  // namespace

double EnergyDistance(const MatrixXd& x, const MatrixXd& y) {
  return std::max(0., 2 * MeanDistance(x, y) - MeanDistance(x, x) - MeanDistance(y, y));
}

double MaximumMeanDiscrepancy(const MatrixXd& x, const MatrixXd& y, double scale) {
  const auto kernel = [scale](double squared) {
    double sum = 0;
    for (const double factor : {0.25, 0.5, 1., 2., 4.}) {
      sum += std::exp(-squared / (2 * factor * factor * scale * scale)) / 5;
    }
    return sum;
  };
  const auto within = [&kernel](const MatrixXd& set) {
    const double n = static_cast<double>(set.cols());
    return n < 2 ? 1 : (SumOverPairs(set, set, kernel) - n) / (n * (n - 1));
  };
  const double pairs = static_cast<double>(x.cols()) * static_cast<double>(y.cols());
  return within(x) + within(y) - 2 * SumOverPairs(x, y, kernel) / pairs;
}

double SlicedWasserstein(const MatrixXd& x, const MatrixXd& y, const MatrixXd& directions) {
  double sum = 0;
  for (const auto direction : directions.colwise()) {
    sum += Wasserstein(x.transpose() * direction, y.transpose() * direction);
  }
  return sum / static_cast<double>(directions.cols());
}

SetDistance MakeDistance(const std::string& name, const MatrixXd& recorded, uint64_t seed) {
  if (recorded.cols() == 0 || recorded.rows() == 0 || !recorded.allFinite()) {
    throw std::invalid_argument("a distance needs a recorded set that is finite and not empty");
  }
  const Whitening whiten = MakeWhitening(recorded);
  const MatrixXd y = whiten(recorded);
  const auto comparable = [](const MatrixXd& x) { return x.cols() > 0 && x.allFinite(); };
  if (name == "energy") {
    return
        [=](const MatrixXd& x) { return comparable(x) ? EnergyDistance(whiten(x), y) : kInfinity; };
  }
  if (name == "mmd") {
    const double scale = MedianDistance(y);
    return [=](const MatrixXd& x) {
      return comparable(x) ? MaximumMeanDiscrepancy(whiten(x), y, scale) : kInfinity;
    };
  }
  if (name == "sliced-wasserstein") {
    constexpr Index kDirections = 64;
    Random random(seed);
    const MatrixXd directions =
        StandardNormals(recorded.rows(), kDirections, random).colwise().normalized();
    return [=](const MatrixXd& x) {
      return comparable(x) ? SlicedWasserstein(whiten(x), y, directions) : kInfinity;
    };
  }
  throw std::invalid_argument("no distance \"" + name +
                              "\"; there are energy, mmd and sliced-wasserstein");
}

VectorXd Distances(const std::string& name, const MatrixXd& outcomes, const VectorXd& observed,
                   const VectorXd& scale) {
  if (name != "squared" && name != "absolute" && name != "mahalanobis") {
    throw std::invalid_argument("no distance \"" + name +
                                "\"; there are squared, absolute and mahalanobis");
  }
  VectorXd result(outcomes.cols());
  for (Index j = 0; j < outcomes.cols(); ++j) {
    double sum = 0;
    for (Index i = 0; i < observed.size(); ++i) {
      if (std::isnan(observed(i)) || !(scale(i) > 0)) continue;
      const double offset = std::abs(outcomes(i, j) - observed(i)) / scale(i);
      sum += name == "absolute" ? offset : offset * offset;
    }
    result(j) = !outcomes.col(j).allFinite() ? kInfinity
                : name == "mahalanobis"      ? std::sqrt(sum)
                                             : sum;
  }
  return result;
}

VectorXd MedianDeviation(const MatrixXd& outcomes) {
  std::vector<Index> finite;
  for (Index j = 0; j < outcomes.cols(); ++j) {
    if (outcomes.col(j).allFinite()) finite.push_back(j);
  }
  VectorXd deviation = VectorXd::Zero(outcomes.rows());
  for (Index i = 0; i < outcomes.rows() && !finite.empty(); ++i) {
    std::vector<double> values;
    values.reserve(finite.size());
    for (const Index j : finite) values.push_back(outcomes(i, j));
    const double centre = Median(values);
    for (double& value : values) value = std::abs(value - centre);
    deviation(i) = kSdOverMedianDeviation * Median(std::move(values));
  }
  return deviation;
}

VectorXd RobustScale(const MatrixXd& outcomes, const VectorXd& observed) {
  VectorXd deviation = MedianDeviation(outcomes);
  VectorXd offset = VectorXd::Zero(observed.size());
  Index far = 0, compared = 0;
  for (Index i = 0; i < observed.size(); ++i) {
    if (std::isnan(observed(i))) continue;
    std::vector<double> finite;
    for (Index j = 0; j < outcomes.cols(); ++j) {
      if (outcomes.col(j).allFinite()) finite.push_back(outcomes(i, j));
    }
    if (finite.empty()) continue;
    offset(i) = std::abs(Median(std::move(finite)) - observed(i));
    far += offset(i) > 2 * deviation(i);
    ++compared;
  }
  if (3 * far > compared) return deviation;
  // A statistic that never varies says nothing, however far off it is.
  return (deviation.array() > 0).select(deviation + offset, 0.);
}

}  // namespace plumb
