#include "calibrator/fit/residual_fit.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "calibrator/fit/contact_residual.h"
#include "calibrator/fit/step_errors.h"
#include "common/decompositions.h"
#include "common/random.h"

namespace plumb {
namespace {

constexpr uint32_t kDrawStream = 0x5265'7344;  // of random numbers; "ResD"

// Of a covariance that an estimate may have made indefinite: the nearest one that is none.
Eigen::MatrixXd LowerFactor(const Eigen::MatrixXd& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance);
  const Eigen::MatrixXd root =
      eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(Eigen::MatrixXd(root.transpose()));
  Eigen::MatrixXd lower = qr.matrixQR().triangularView<Eigen::Upper>().transpose();
  return lower;
}

bool Enough(const std::vector<StepErrors>& draws) {
  return std::all_of(draws.begin(), draws.end(),
                     [](const auto& draw) { return draw.size() >= kFewestForResidual; });
}

// The function of the whole robot, with noise for what it leaves.
ResidualFunction FitWhole(const std::vector<StepErrors>& draws, const FunctionFitOptions& options,
                          double noise, Random random, ResidualQuality* quality) {
  std::vector<Examples> examples;
  examples.reserve(draws.size());
  for (const StepErrors& draw : draws)
    examples.push_back({Columns(draw.inputs), Columns(draw.errors)});
  const FunctionFit fit(std::move(examples), options, random);
  ResidualFunction function = fit.function();
  quality->length = fit.length();
  const Eigen::VectorXd variance = Columns(draws.front().variances).rowwise().mean(),
                        claimed = variance.array().isFinite().select(variance, 0.0);
  const Eigen::MatrixXd left_out = fit.LeftOut(0);
  Eigen::MatrixXd covariance =
      left_out * left_out.transpose() / static_cast<double>(left_out.cols());
  const Eigen::Index n = function.outputs() / 2;  // velocities
  quality->after = covariance.diagonal().tail(n).cwiseSqrt();
  quality->claimed = claimed.tail(n).cwiseSqrt();
  covariance.diagonal() -= claimed;
  function.noise = noise * LowerFactor(covariance);
  Round(&function);
  return function;
}

// Root mean square of the velocities' errors.
Eigen::VectorXd VelocityErrors(const StepErrors& steps) {
  const Eigen::MatrixXd errors = Columns(steps.errors);
  return (errors.bottomRows(errors.rows() / 2).rowwise().squaredNorm() / steps.size()).cwiseSqrt();
}

}  // namespace

ResidualFit FitResidual(const std::shared_ptr<const Model>& model,
                        const Eigen::MatrixXd& coordinates, std::span<const Rollout> rollouts,
                        const ResidualFitOptions& options) {
  ResidualFit fit;
  std::vector<StepErrors> free, touching;
  for (const auto& draw : coordinates.colwise()) {
    fit.residual.coordinates.emplace_back(draw);
    SortedErrors errors =
        CollectErrors(model, model->description().ToPhysical(draw), rollouts, fit.residual.margin);
    free.push_back(std::move(errors.free)), touching.push_back(std::move(errors.touching));
  }
  const auto random = [&](uint32_t condition) {
    return Random(options.seed, {kDrawStream, condition});
  };
  FunctionFitOptions whole{options.centres, options.width, options.unknown};
  fit.free.transitions = free.front().size(), fit.touching.transitions = touching.front().size();
  if (options.free && Enough(free)) {
    fit.free.before = VelocityErrors(free.front());
    fit.residual.free = FitWhole(free, whole, options.noise, random(0), &fit.free);
  }
  if (options.touching && Enough(touching)) {
    if (options.contacts == ResidualFitOptions::Contacts::kSetAside)
      for (StepErrors& draw : touching) SetContactsAside(&draw);
    fit.touching.before = VelocityErrors(touching.front());
    if (options.contacts == ResidualFitOptions::Contacts::kLearnt) {
      ContactFunctions contacts =
          FitContacts({options.contact_centres, options.width, options.unknown_by_contacts},
                      options.seed, &touching);
      fit.residual.ground = std::move(contacts.ground);
      fit.residual.stop = std::move(contacts.stop);
    }
    if (fit.residual.ground || fit.residual.stop)
      whole = {options.rest_centres, options.width, options.unknown_by_contacts};
    fit.residual.touching = FitWhole(touching, whole, options.noise, random(1), &fit.touching);
  }
  return fit;
}

}  // namespace plumb
