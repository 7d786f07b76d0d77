#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <memory>

#include "calibrator/results/findings.h"
#include "calibrator/results/posterior_file.h"
#include "common/random.h"
#include "robot/description.h"
#include "robot/parameter_distribution.h"

namespace plumb {

/// A residual for steps that touch and for contacts with the ground, of two draws, two inputs and
/// three centres; numbers that single precision has.
inline Residual SampleResidual(const RobotDescription& robot) {
  const Eigen::Index n = 2 * robot.num_velocities();
  Random random(6, {1});
  const auto singles = [&](Eigen::Index rows, Eigen::Index columns) {
    Eigen::MatrixXd matrix(rows, columns);
    for (double& number : matrix.reshaped()) number = static_cast<float>(random.Normal());
    return matrix;
  };
  const auto function = [&](Eigen::Index outputs) {
    ResidualFunction f;
    f.mean = singles(2, 1), f.scale = Eigen::Vector2d(0.5, 2);
    f.low = Eigen::Vector2d(-2, -1), f.high = Eigen::Vector2d(1, 3);
    f.centres = singles(3, 2);
    f.weights = {singles(outputs, 6), singles(outputs, 6)};
    f.noise = singles(outputs, outputs);
    f.bound = Eigen::VectorXd::Constant(outputs, 4);
    f.unknown = singles(outputs, 1).cwiseAbs();
    return f;
  };
  Residual residual;
  const Gaussian prior = PriorGaussian(robot);
  residual.coordinates = {prior.mean, prior.mean + 0.1 * prior.covariance.diagonal().cwiseSqrt()};
  residual.touching = function(n), residual.ground = function(4);
  return residual;
}

/// Findings of a robot that nobody has calibrated: every field holds something, two components, and
/// some numbers that are not finite where they may be so.
inline Findings SampleFindings(const RobotDescription& robot) {
  const auto n = static_cast<Eigen::Index>(robot.parameters.size());
  Random random(5, {1});
  Findings f;
  f.method = "auto", f.used = "smc", f.seed = 0xfedcba9876543210;
  f.prior = PriorGaussian(robot);
  const Eigen::VectorXd prior_sd = f.prior.covariance.diagonal().cwiseSqrt();
  // The first direction stays unknown, the rest shrink.
  Eigen::VectorXd null = prior_sd.normalized();
  for (Eigen::Index i = 1; i < n; i += 2) null(i) *= -1;
  for (const double shift : {-0.15, 0.25}) {
    const Eigen::MatrixXd covariance = 0.02 * f.prior.covariance + 0.3 * prior_sd.squaredNorm() /
                                                                       static_cast<double>(n) *
                                                                       null * null.transpose();
    f.posterior.components.push_back({f.prior.mean + shift * prior_sd, covariance});
  }
  f.posterior.weights = {0.7, 0.3};
  f.samples.resize(n, 1500);
  for (auto column : f.samples.colwise()) column = robot.ToPhysical(Sample(f.posterior, random));
  f.transitions = 995, f.simulated_steps = 123456, f.diagnostic_steps = 4321, f.failures = 2;
  f.discrepancy = 1.02;
  f.noise_sd = Eigen::VectorXd::Constant(2 * robot.num_velocities(), 1e-3);
  for (const int horizon : {1, 5, 20}) {
    f.stages.push_back({horizon, 995 / horizon, 40000, 1 + 0.5 / horizon, f.prior.mean,
                        prior_sd / (2. + horizon)});
  }
  f.identifiability.information =
      Eigen::MatrixXd::Identity(n, n) - null * null.transpose() * (1 - 1e-9);
  f.identifiability.null = {null / null.cwiseAbs().maxCoeff()};
  f.identifiability.combinations = {{"gravity / length", Eigen::VectorXd::Unit(n, 0), 9.81, 0.02}};
  f.identifiability.summary = "only gravity / length can be known from this motion";
  f.cramer_rao = 0.05 * prior_sd;
  f.cramer_rao(0) = std::numeric_limits<double>::infinity();
  f.holdout = {
      800,
      195,
      {{1, 195, 1e-3, 4e-3}, {5, 39, 4e-3, 2e-2}, {20, 9, 9e-3, 0.12}, {100, 0, NAN, NAN}},
      true,
      "predicts better than the prior at every horizon that could be tried (1, 5 and 20 steps)"};
  f.misspecification = {
      true,
      {{"pivot, at ground contact", "pivot", "contact", "structure", 12.5, 1e-6, 0.31},
       {"all joints", "", "", "whiteness", 3.1, 0.004, NAN}},
      "the model does not explain the robot: pivot, at ground contact"};
  f.gap.informed = Informed::kFree;
  f.gap.residual = std::make_shared<const Residual>(SampleResidual(robot));
  f.gap.free.transitions = 700;
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(robot.num_velocities());
  f.gap.touching = {295, 0.2 * one, 0.1 * one, 0.05 * one, 4};
  f.gap.summary = "the model does not explain contact";
  f.agreement = {true,
                 {{"monday.lcm", f.samples.col(0), 0.05 * f.samples.col(0).cwiseAbs(), 1.2, 0.4},
                  {"tuesday.lcm", f.samples.col(1), 0.05 * f.samples.col(1).cwiseAbs(), 0.8, 0.7}},
                 "both logs can be of one robot"};
  f.check = "importance weights of 1000 samples: effective share 0.93";
  f.warnings = {"12 transitions were late"};
  f.seconds = 12.34;
  return f;
}

inline Provenance SampleProvenance() {
  return {{"monday.lcm", "tuesday.lcm"},
          {{"method", "auto"}, {"horizons", "1,5,20"}},
          "plumb calibrate robots/pendulum monday.lcm tuesday.lcm --seed 3",
          "2026-01-02T03:04:05Z"};
}

}  // namespace plumb
