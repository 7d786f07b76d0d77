#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "calibrator/fit/residual_function_fit.h"
#include "calibrator/motion/transitions.h"
#include "robot/residual.h"
#include "sim/model.h"

namespace plumb {

struct ResidualFitOptions {
  bool free = true, touching = true;  ///< where the simulator is to be corrected
  /// what becomes of contacts' own errors in touching steps: they have functions of their
  /// own (FitContacts); or they are taken away, and what is left is looked at
  enum class Contacts { kLearnt, kSetAside } contacts = Contacts::kLearnt;
  int centres = 256;         ///< of its functions of free steps, or of touching ones without those
  int contact_centres = 96;  ///< of the functions of contacts
  int rest_centres = 128;    ///< of the function of what those leave
  /// of the weights: 0 = their posterior's mean for each draw of the parameters, 1 = as uncertain
  /// as they are
  double width = 0;
  double noise = 1;  ///< factor of what is left
  /// factor of the sd that the evidence says of a change before anything is known: without
  /// functions of contacts, and with them
  double unknown = 0.3, unknown_by_contacts = 0.1;
  uint64_t seed = 1;
};

/// A condition's fit in numbers, each of n entries, of velocities; empty where there is no
/// function.
struct ResidualQuality {
  int transitions = 0;
  Eigen::VectorXd before;   ///< rms error of one step without the residual [rad/s or m/s]
  Eigen::VectorXd after;    ///< with it, each transition predicted by the others (leave-one-out)
  Eigen::VectorXd claimed;  ///< that readings alone would make
  double length = 0;        ///< of the features, in units of the inputs' sd
};

struct ResidualFit {
  Residual residual;
  ResidualQuality free, touching;
};

/// Learns what a simulator lacks from one-step errors of positions and velocities, given its
/// parameters: a Gaussian process in closed form (ResidualRegression), the kernel's length for all
/// outputs that of the greatest evidence. Of touching steps first what their contacts have wrong
/// (FitContacts), then what is left. Noise is the covariance of leave-one-out errors
/// less that of the readings. A condition of fewer than kFewestForResidual transitions has no
/// residual. Thread-safe; the same bits each time.
/// @param coordinates of the simulators to be corrected, a column each, at least one; the first one
/// decides the scales.
/// @throws std::invalid_argument for parameters that are none.
ResidualFit FitResidual(const std::shared_ptr<const Model>& model,
                        const Eigen::MatrixXd& coordinates, std::span<const Rollout> rollouts,
                        const ResidualFitOptions& options);

}  // namespace plumb
