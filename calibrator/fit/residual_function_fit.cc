#include "calibrator/fit/residual_function_fit.h"

#include <limits>
#include <utility>

namespace plumb {
namespace {

constexpr double kLengths[] = {2, 3, 4, 6, 8};  // in units of the inputs' sd
constexpr double kBoundOfSeen = 2;
constexpr double kNoError = 1e-9;  // an error that is none

template <class Matrix>
void RoundEntries(Matrix* matrix) {
  *matrix = matrix->template cast<float>().template cast<double>().eval();
}

}  // namespace

FunctionFit::FunctionFit(std::vector<Examples> draws, const FunctionFitOptions& options,
                         Random random)
    : draws_(std::move(draws)), features_(draws_.front().inputs, options.centres) {
  const ResidualRegression first = Choose(draws_.front());
  function_ = features_.function();
  for (const Examples& draw : draws_) {
    regressions_.push_back(first.Again(features_.Of(draw.inputs), draw.outputs));
    function_.weights.push_back(
        features_.Unwhitened(regressions_.back().Weights(options.width, random)));
  }
  const Eigen::MatrixXd& outputs = draws_.front().outputs;
  function_.noise = Eigen::MatrixXd::Zero(outputs.rows(), outputs.rows());
  function_.bound = kBoundOfSeen * outputs.cwiseAbs().rowwise().maxCoeff().array().max(kNoError);
  function_.unknown = options.unknown * (first.variance.array() / first.ratio.array()).sqrt();
}

// The features of the greatest evidence.
ResidualRegression FunctionFit::Choose(const Examples& examples) {
  ResidualRegression best;
  best.evidence = -std::numeric_limits<double>::infinity();
  for (const double candidate : kLengths) {
    features_.SetLength(candidate);
    ResidualRegression regression =
        ResidualRegression::Fit(features_.Of(examples.inputs), examples.outputs);
    if (regression.evidence > best.evidence) best = std::move(regression), length_ = candidate;
  }
  features_.SetLength(length_);
  return best;
}

Eigen::MatrixXd FunctionFit::LeftOut(size_t draw) const {
  return regressions_[draw].LeftOut(features_.Of(draws_[draw].inputs), draws_[draw].outputs);
}

void Round(ResidualFunction* f) {
  for (Eigen::VectorXd* x : {&f->mean, &f->scale, &f->low, &f->high, &f->bound, &f->unknown})
    RoundEntries(x);
  RoundEntries(&f->centres), RoundEntries(&f->noise);
  for (Eigen::MatrixXd& weights : f->weights) RoundEntries(&weights);
}

}  // namespace plumb
