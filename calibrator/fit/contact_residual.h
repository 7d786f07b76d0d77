#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "calibrator/fit/residual_function_fit.h"
#include "calibrator/fit/step_errors.h"
#include "robot/residual.h"

namespace plumb {

/// Residual::ground and Residual::stop; empty where fewer than kFewestForResidual contacts were
/// seen.
struct ContactFunctions {
  std::optional<ResidualFunction> ground, stop;
};

/// Learns what contacts have wrong: each one's own part of a step's errors (OwnErrors), as a
/// function of what it did. They have no noise: what they leave is another function's.
/// Takes from the errors what the functions say of them, each contact's learnt from the others
/// (leave-one-out). Thread-safe; the same bits each time.
/// @param draws touching steps by the simulators of several parameters, at least one.
ContactFunctions FitContacts(const FunctionFitOptions& options, uint64_t seed,
                             std::vector<StepErrors>* draws);

/// How much of errors of n velocities, or of n positions, each contact has made, k entries each, in
/// its own directions: u that explains them best as sum of response * u, in the metric of the mass
/// matrix, and no more than that needs, as two points of one rigid foot move as one. Thread-safe.
std::vector<Eigen::VectorXd> OwnErrors(const std::vector<StepContacts::Contact>& contacts,
                                       const Eigen::VectorXd& errors);

/// The same of a step's errors in n positions and n velocities: 2 k entries of each contact, its
/// displacement and its velocity. Thread-safe.
std::vector<Eigen::VectorXd> OwnStepErrors(const std::vector<StepContacts::Contact>& contacts,
                                           const Eigen::VectorXd& errors);

/// Takes from the errors of touching steps all that their contacts can have made (OwnStepErrors).
/// Thread-safe.
void SetContactsAside(StepErrors* touching);

}  // namespace plumb
