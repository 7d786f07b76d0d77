#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/gaussian.h"
#include "common/random.h"
#include "plumb/parameter_distribution_t.hpp"
#include "robot/description.h"
#include "robot/residual.h"

namespace plumb {

/// The description's prior over the P coordinates: independent, in the order of
/// RobotDescription::parameters. Thread-safe.
Gaussian PriorGaussian(const RobotDescription& description);

/// A simulator.
struct SimulatorDraw {
  // Most are nothing but parameters.
  SimulatorDraw(Eigen::VectorXd physical) : parameters(std::move(physical)) {}  // NOLINT

  Eigen::VectorXd parameters;  ///< physical units
  /// that the simulator lacks, and which draw of it; null = nothing
  std::shared_ptr<const Residual> residual = nullptr;
  size_t draw = 0;
  /// the state (q, v) that an episode begins with; empty = one of the task's
  Eigen::VectorXd start = {};
};

/// Which simulators could have produced a robot's motion: a mixture of Gaussians over the
/// *coordinates* of the uncertain parameters (see ParameterDescription::coordinate), in the order
/// of RobotDescription::parameters. Immutable use is thread-safe.
struct ParameterDistribution {
  /// More is no distribution but an attack.
  static constexpr int kMaxComponents = 1000;
  /// A covariance that has been through arithmetic: eigenvalues this far below zero, relative to
  /// the largest, are zero.
  static constexpr double kRounding = 1e-9;

  int iteration = 0;                             ///< of SimOpt; 0 = the prior
  std::vector<ParameterDescription> parameters;  ///< P
  /// of P coordinates; covariances may be singular: of a parameter that is known exactly, or
  /// exactly tied to another
  GaussianMixture mixture;
  /// that all of these simulators lack; null = nothing
  std::shared_ptr<const Residual> residual = nullptr;
  /// Whether these simulators, without a residual, are known to explain the robot, but for what is
  /// too little to matter: false also where nobody has asked, or could tell.
  bool explained = false;

  /// States (q, v) of the robot, num_positions + num_velocities entries, that simulated episodes
  /// may begin with: those in which roll-outs have begun, and some of their motion.
  std::vector<Eigen::VectorXd> starts = {};

  /// The description's prior: one component with a diagonal covariance.
  static ParameterDistribution Prior(const RobotDescription& description);
  /// The one simulator of the prior's means (physical units).
  static ParameterDistribution Nominal(const RobotDescription& description);

  /// A message's distribution. @throws std::invalid_argument saying what is wrong: names or
  /// coordinates that are not the description's, counts that do not fit, numbers that are not
  /// finite, weights that do not sum to 1, a covariance that is not symmetric and positive
  /// semidefinite, a residual of simulators that explain the robot without one.
  static ParameterDistribution FromMessage(const parameter_distribution_t& message,
                                           const RobotDescription& description);
  /// The message, except for utime, seed (0) and diagnostics (NaN), which are the sender's to fill
  /// in.
  parameter_distribution_t ToMessage() const;

  int size() const { return static_cast<int>(parameters.size()); }
  /// Draws a simulator: of the mixture, or, where there is a residual, one of its draws, and in
  /// kPlainShare of the cases, one of the mixture as it is. A residual is right only near what was
  /// recorded: a policy that exploits it elsewhere must not be a good one.
  SimulatorDraw Draw(Random& random) const;
  static constexpr double kPlainShare = 0.2;
  /// Half of the episodes begin in one of the starts, if there are any: however the robot is
  /// placed, it has moved before the first command arrives.
  static constexpr double kRecordedStarts = 0.5;
  /// Draws parameters of the mixture. @return P values in physical units.
  Eigen::VectorXd Sample(Random& random) const;
  /// Draws a simulator. @return P values in coordinates.
  Eigen::VectorXd SampleCoordinates(Random& random) const;
  Eigen::VectorXd ToPhysical(const Eigen::VectorXd& coordinates) const;

  /// Mean and standard deviation of the mixture, P values in physical units; for a logarithmic
  /// coordinate those of the log-normal: mean e^(m + s^2/2), variance (e^(s^2) - 1) e^(2m + s^2).
  Eigen::VectorXd Mean() const;
  Eigen::VectorXd Sd() const;
};

}  // namespace plumb
