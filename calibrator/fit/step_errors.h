#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "calibrator/motion/transitions.h"
#include "sim/model.h"
#include "sim/step_contacts.h"

namespace plumb {

/// One-step errors of a simulator in n positions and n velocities, for a residual to learn from:
/// an entry of each list for each transition.
struct StepErrors {
  std::vector<Eigen::VectorXd> inputs;     ///< ResidualInputs
  std::vector<Eigen::VectorXd> errors;     ///< 2 n: recorded less simulated
  std::vector<Eigen::VectorXd> variances;  ///< 2 n, that readings alone would make; may be infinite
  std::vector<std::vector<StepContacts::Contact>> contacts;  ///< what touched
  struct Place {
    size_t rollout, transition;
  };
  std::vector<Place> places;

  int size() const { return static_cast<int>(inputs.size()); }
};

/// Those of steps that touch nothing, and of the others.
struct SortedErrors {
  StepErrors free, touching;
};

/// Of all transitions whose end was observed and which can be simulated. Thread-safe.
/// @param physical parameters of the simulator. @param margin [m], [rad] see StepContacts.
/// @throws std::invalid_argument as ResidualInputs and Parameters::Apply.
SortedErrors CollectErrors(const std::shared_ptr<const Model>& model,
                           const Eigen::VectorXd& physical, std::span<const Rollout> rollouts,
                           double margin);

/// A matrix of these columns, at least one.
Eigen::MatrixXd Columns(std::span<const Eigen::VectorXd> columns);

}  // namespace plumb
