#include "calibrator/fit/residual_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "common/decompositions.h"
#include "common/random.h"
#include "sim/residual_inputs.h"
#include "sim/simulator.h"

namespace plumb {
namespace {

constexpr uint32_t kFeatureStream = 0x5265'7346, kDrawStream = 0x5265'7344;  // "ResF", "ResD"
constexpr double kLengths[] = {2, 4, 8};  // in units of the inputs' sd
constexpr double kBoundOfSeen = 2;
constexpr double kStill = 1e-9;         // an input's sd below which it does not move
constexpr double kLeastFreedom = 1e-3;  // 1 - leverage of a transition

// One-step errors of a condition, a column for each transition.
struct Errors {
  std::vector<Eigen::VectorXd> inputs, velocities, variances;
  Eigen::Index size() const { return static_cast<Eigen::Index>(inputs.size()); }
};

Eigen::MatrixXd Columns(const std::vector<Eigen::VectorXd>& columns) {
  Eigen::MatrixXd matrix(columns.front().size(), static_cast<Eigen::Index>(columns.size()));
  for (size_t i = 0; i < columns.size(); ++i) matrix.col(static_cast<Eigen::Index>(i)) = columns[i];
  return matrix;
}

Eigen::VectorXd MeanEffort(const Transition& transition) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(transition.efforts.front().effort.size());
  for (const EffortSegment& segment : transition.efforts) sum += segment.duration * segment.effort;
  return sum / transition.duration();
}

void Collect(const std::shared_ptr<const Model>& model, const Eigen::VectorXd& physical,
             std::span<const Rollout> rollouts, double margin, Errors* free, Errors* touching) {
  ResidualInputs inputs(*model, margin);
  Simulator simulator(model);
  simulator.SetParameters(physical);
  for (const Rollout& rollout : rollouts) {
    const Transition* last = nullptr;
    for (const Transition& t : rollout.transitions) {
      const bool follows = last && last->step + 1 == t.step;
      const Eigen::VectorXd effort = MeanEffort(t), before = follows ? MeanEffort(*last) : effort;
      if (t.next_v.allFinite()) {
        simulator.SetState(t.q, t.v);
        if (follows) simulator.Recall(last->efforts);
        inputs.Begin(simulator, effort, before, t.duration());
        simulator.Step(t.efforts);
        inputs.End(simulator);
        if (simulator.finite()) {
          Errors& errors = inputs.touching() ? *touching : *free;
          errors.inputs.push_back(inputs.x());
          errors.velocities.push_back(t.next_v - simulator.v());
          errors.variances.push_back(t.next_v_sd.cwiseAbs2() + t.v_sd.cwiseAbs2());
        }
      }
      last = &t;
    }
  }
}

// The regression of all velocities on the same features.
struct Regression {
  Eigen::VectorXd eigenvalues;   // of Phi Phi'
  Eigen::MatrixXd eigenvectors;  // columns
  Eigen::MatrixXd projected;     // eigenvectors' Phi y, a column for each velocity
  Eigen::VectorXd ratio;         // noise to prior variance of the weights, each velocity
  Eigen::VectorXd variance;      // of the noise
  double evidence = 0;           // ln, of all velocities
};

// ln evidence of a velocity's errors, the noise's variance at its best.
double Evidence(const Regression& r, Eigen::Index k, double square, double count, double ratio,
                double* variance) {
  const Eigen::ArrayXd spread = r.eigenvalues.array() + ratio;
  const double rest = square - (r.projected.col(k).array().square() / spread).sum();
  *variance = std::max(rest / count, 1e-300);
  return -0.5 * (count * std::log(2 * std::numbers::pi * *variance) + count +
                 (spread / ratio).log().sum());
}

Regression Project(const Eigen::MatrixXd& features, const Eigen::MatrixXd& errors) {
  Regression r;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
      Eigen::MatrixXd(features * features.transpose()));
  r.eigenvalues = eigen.eigenvalues().cwiseMax(0);
  r.eigenvectors = eigen.eigenvectors();
  r.projected = r.eigenvectors.transpose() * (features * errors.transpose());
  return r;
}

Regression Regress(const Eigen::MatrixXd& features, const Eigen::MatrixXd& errors) {
  Regression r = Project(features, errors);
  r.ratio.resize(errors.rows()), r.variance.resize(errors.rows());
  const auto count = static_cast<double>(errors.cols());
  for (Eigen::Index k = 0; k < errors.rows(); ++k) {
    const double square = errors.row(k).squaredNorm();
    double best = -std::numeric_limits<double>::infinity();
    for (double exponent = -4; exponent <= 6; exponent += 0.25) {
      const double ratio = std::pow(10.0, exponent);
      double variance;
      const double evidence = Evidence(r, k, square, count, ratio, &variance);
      if (evidence > best) best = evidence, r.ratio(k) = ratio, r.variance(k) = variance;
    }
    r.evidence += best;
  }
  return r;
}

Eigen::MatrixXd FeaturesOf(const ResidualFunction& function, const Eigen::MatrixXd& inputs) {
  Eigen::MatrixXd features(1 + function.inputs() + function.phases.size(), inputs.cols());
  for (Eigen::Index i = 0; i < inputs.cols(); ++i)
    function.Features(inputs.col(i), features.col(i));
  return features;
}

// Of a covariance that an estimate may have made indefinite: the nearest one that is none.
Eigen::MatrixXd LowerFactor(const Eigen::MatrixXd& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance);
  const Eigen::MatrixXd root =
      eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(Eigen::MatrixXd(root.transpose()));
  Eigen::MatrixXd lower = qr.matrixQR().triangularView<Eigen::Upper>().transpose();
  return lower;
}

// The inputs' scale, and features of the greatest evidence.
ResidualFunction ChooseFeatures(const Eigen::MatrixXd& inputs, const Eigen::MatrixXd& errors,
                                int features, Random random, Regression* best,
                                ResidualQuality* quality) {
  const Eigen::Index d = inputs.rows(), m = features;
  ResidualFunction function;
  function.mean = inputs.rowwise().mean();
  function.scale = (inputs.colwise() - function.mean).rowwise().norm() /
                   std::sqrt(static_cast<double>(inputs.cols()));
  function.scale = (function.scale.array() > kStill).select(function.scale, 1.0);
  const Eigen::MatrixXd z =
      function.scale.cwiseInverse().asDiagonal() * (inputs.colwise() - function.mean).eval();
  function.low = z.rowwise().minCoeff(), function.high = z.rowwise().maxCoeff();
  Eigen::MatrixXd unit(m, d);
  for (Eigen::Index i = 0; i < m; ++i)
    for (Eigen::Index j = 0; j < d; ++j) unit(i, j) = random.Normal();
  function.phases.resize(m);
  for (double& phase : function.phases) phase = random.Uniform(0, 2 * std::numbers::pi);
  best->evidence = -std::numeric_limits<double>::infinity();
  for (const double length : kLengths) {
    function.frequencies = unit / length;
    Regression regression = Regress(FeaturesOf(function, inputs), errors);
    if (!(regression.evidence > best->evidence)) continue;
    *best = std::move(regression);
    quality->length = length;
  }
  function.frequencies = unit / quality->length;
  return function;
}

// The weights for one simulator's errors, drawn.
Eigen::MatrixXd Weights(const Regression& r, double width, Random& random) {
  Eigen::MatrixXd weights(r.ratio.size(), r.eigenvalues.size());
  for (Eigen::Index k = 0; k < weights.rows(); ++k) {
    const Eigen::VectorXd inverse = (r.eigenvalues.array() + r.ratio(k)).inverse();
    Eigen::VectorXd rotated = inverse.cwiseProduct(r.projected.col(k));
    if (width > 0) {
      for (Eigen::Index i = 0; i < rotated.size(); ++i)
        rotated(i) += width * std::sqrt(r.variance(k) * inverse(i)) * random.Normal();
    }
    weights.row(k) = (r.eigenvectors * rotated).transpose();
  }
  return weights;
}

// Errors of each transition, predicted by the others' regression.
Eigen::MatrixXd LeftOut(const Regression& r, const Eigen::MatrixXd& features,
                        const Eigen::MatrixXd& errors) {
  const Eigen::MatrixXd rotated = r.eigenvectors.transpose() * features;
  Eigen::MatrixXd left_out(errors.rows(), errors.cols());
  for (Eigen::Index k = 0; k < errors.rows(); ++k) {
    const Eigen::ArrayXd inverse = (r.eigenvalues.array() + r.ratio(k)).inverse();
    const Eigen::RowVectorXd fitted =
        (inverse * r.projected.col(k).array()).matrix().transpose() * rotated;
    const Eigen::RowVectorXd leverage =
        (rotated.array().square().colwise() * inverse).colwise().sum();
    left_out.row(k) = (errors.row(k) - fitted).array() / (1 - leverage.array()).max(kLeastFreedom);
  }
  return left_out;
}

// To single precision: they are not known better, and as messages have them.
template <class Matrix>
void Round(Matrix* matrix) {
  *matrix = matrix->template cast<float>().template cast<double>().eval();
}

void Round(ResidualFunction* f) {
  for (Eigen::VectorXd* x : {&f->mean, &f->scale, &f->low, &f->high, &f->phases, &f->bound})
    Round(x);
  Round(&f->frequencies), Round(&f->noise);
  for (Eigen::MatrixXd& weights : f->weights) Round(&weights);
}

std::optional<ResidualFunction> FitFunction(const std::vector<Errors>& draws,
                                            const ResidualFitOptions& options, uint32_t condition,
                                            ResidualQuality* quality) {
  quality->transitions = static_cast<int>(draws.front().size());
  for (const Errors& draw : draws) {
    if (draw.size() < kFewestForResidual) return {};
  }
  const Eigen::MatrixXd inputs = Columns(draws.front().inputs),
                        errors = Columns(draws.front().velocities);
  Regression first;
  ResidualFunction function =
      ChooseFeatures(inputs, errors, options.features,
                     Random(options.seed, {kFeatureStream, condition}), &first, quality);
  Random random(options.seed, {kDrawStream, condition});
  for (const Errors& draw : draws) {
    Regression own = Project(FeaturesOf(function, Columns(draw.inputs)), Columns(draw.velocities));
    own.ratio = first.ratio, own.variance = first.variance;
    function.weights.push_back(Weights(own, options.width, random));
  }
  const auto count = static_cast<double>(errors.cols());
  const Eigen::VectorXd variance = Columns(draws.front().variances).rowwise().mean(),
                        claimed = variance.array().isFinite().select(variance, 0.0);
  const Eigen::MatrixXd left_out = LeftOut(first, FeaturesOf(function, inputs), errors);
  Eigen::MatrixXd covariance = left_out * left_out.transpose() / count;
  quality->before = (errors.rowwise().squaredNorm() / count).cwiseSqrt();
  quality->after = covariance.diagonal().cwiseSqrt();
  quality->claimed = claimed.cwiseSqrt();
  covariance.diagonal() -= claimed;
  function.noise = options.noise * LowerFactor(covariance);
  function.bound = kBoundOfSeen * errors.cwiseAbs().rowwise().maxCoeff().array().max(kStill);
  Round(&function);
  return function;
}

}  // namespace

ResidualFit FitResidual(const std::shared_ptr<const Model>& model,
                        const Eigen::MatrixXd& coordinates, std::span<const Rollout> rollouts,
                        const ResidualFitOptions& options) {
  ResidualFit fit;
  const auto draws = static_cast<size_t>(coordinates.cols());
  std::vector<Errors> free(draws), touching(draws);
  for (size_t k = 0; k < draws; ++k) {
    const Eigen::VectorXd draw = coordinates.col(static_cast<Eigen::Index>(k));
    fit.residual.coordinates.push_back(draw);
    Collect(model, model->description().ToPhysical(draw), rollouts, fit.residual.margin, &free[k],
            &touching[k]);
  }
  if (options.free) fit.residual.free = FitFunction(free, options, 0, &fit.free);
  if (options.touching) fit.residual.touching = FitFunction(touching, options, 1, &fit.touching);
  return fit;
}

}  // namespace plumb
