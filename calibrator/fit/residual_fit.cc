#include "calibrator/fit/residual_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "calibrator/fit/residual_regression.h"
#include "common/decompositions.h"
#include "common/random.h"
#include "sim/residual_inputs.h"
#include "sim/simulator.h"

namespace plumb {
namespace {

constexpr uint32_t kDrawStream = 0x5265'7344;   // of random numbers; "ResD"
constexpr double kLengths[] = {2, 3, 4, 6, 8};  // in units of the inputs' sd
constexpr double kBoundOfSeen = 2;
constexpr double kStill = 1e-9;  // an error that is none

// One-step errors of a condition, a column for each transition.
struct Errors {
  std::vector<Eigen::VectorXd> inputs, states, variances;
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

Eigen::VectorXd Stack(const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
  Eigen::VectorXd both(q.size() + v.size());
  both << q, v;
  return both;
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
      if (t.next_q.allFinite() && t.next_v.allFinite()) {
        simulator.SetState(t.q, t.v);
        if (follows) simulator.Recall(last->efforts);
        inputs.Begin(simulator);
        simulator.Step(t.efforts);
        inputs.End(simulator, effort, before, t.duration());
        if (simulator.finite()) {
          Errors& errors = inputs.touching() ? *touching : *free;
          errors.inputs.push_back(inputs.x());
          errors.states.push_back(Stack(t.next_q - simulator.q(), t.next_v - simulator.v()));
          errors.variances.push_back(Stack(t.next_q_sd.cwiseAbs2() + t.q_sd.cwiseAbs2(),
                                           t.next_v_sd.cwiseAbs2() + t.v_sd.cwiseAbs2()));
        }
      }
      last = &t;
    }
  }
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

// To single precision: they are not known better, and as messages have them.
template <class Matrix>
void Round(Matrix* matrix) {
  *matrix = matrix->template cast<float>().template cast<double>().eval();
}

void Round(ResidualFunction* f) {
  for (Eigen::VectorXd* x : {&f->mean, &f->scale, &f->low, &f->high, &f->bound, &f->unknown})
    Round(x);
  Round(&f->centres), Round(&f->noise);
  for (Eigen::MatrixXd& weights : f->weights) Round(&weights);
}

// The features of the greatest evidence.
ResidualRegression Choose(const Eigen::MatrixXd& inputs, const Eigen::MatrixXd& errors,
                          ResidualFeatures* features, double* length) {
  ResidualRegression best;
  best.evidence = -std::numeric_limits<double>::infinity();
  for (const double candidate : kLengths) {
    features->SetLength(candidate);
    ResidualRegression regression = ResidualRegression::Fit(features->Of(inputs), errors);
    if (regression.evidence > best.evidence) best = std::move(regression), *length = candidate;
  }
  features->SetLength(*length);
  return best;
}

std::optional<ResidualFunction> FitFunction(const std::vector<Errors>& draws,
                                            const ResidualFitOptions& options, uint32_t condition,
                                            ResidualQuality* quality) {
  quality->transitions = static_cast<int>(draws.front().size());
  for (const Errors& draw : draws) {
    if (draw.size() < kFewestForResidual) return {};
  }
  const Eigen::MatrixXd inputs = Columns(draws.front().inputs),
                        errors = Columns(draws.front().states);
  ResidualFeatures features(inputs, options.centres);
  const ResidualRegression first = Choose(inputs, errors, &features, &quality->length);
  ResidualFunction function = features.function();
  Random random(options.seed, {kDrawStream, condition});
  for (const Errors& draw : draws) {
    const auto own = first.Again(features.Of(Columns(draw.inputs)), Columns(draw.states));
    function.weights.push_back(features.Unwhitened(own.Weights(options.width, random)));
  }
  const auto count = static_cast<double>(errors.cols());
  const Eigen::VectorXd variance = Columns(draws.front().variances).rowwise().mean(),
                        claimed = variance.array().isFinite().select(variance, 0.0);
  const Eigen::MatrixXd left_out = first.LeftOut(features.Of(inputs), errors);
  Eigen::MatrixXd covariance = left_out * left_out.transpose() / count;
  const Eigen::Index n = errors.rows() / 2;  // velocities
  quality->before = (errors.bottomRows(n).rowwise().squaredNorm() / count).cwiseSqrt();
  quality->after = covariance.diagonal().tail(n).cwiseSqrt();
  quality->claimed = claimed.tail(n).cwiseSqrt();
  covariance.diagonal() -= claimed;
  function.noise = options.noise * LowerFactor(covariance);
  function.bound = kBoundOfSeen * errors.cwiseAbs().rowwise().maxCoeff().array().max(kStill);
  function.unknown = options.unknown * (first.variance.array() / first.ratio.array()).sqrt();
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
