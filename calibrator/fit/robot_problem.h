#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "calibrator/fit/window_errors.h"
#include "calibrator/inference/laplace.h"
#include "calibrator/inference/problem.h"

namespace plumb {

// The problem uses its errors and their threads: one thread at a time.

/// A robot's log for methods that know only simulations. A simulation makes a record like the
/// robot's: the recorded steps from the recorded states, and noise as large as a first fit has
/// found it. Its outcome depends on `discrepancy`:
///   likelihood   the scores of the first fit, J'(e + noise) in units of their spread: n numbers
///                that hold all that Gaussian errors near that fit can tell (semi-automatic
///                summaries: Fearnhead, Prangle, J. R. Stat. Soc. B 74, 2012)
///   squared, absolute   mean of |e|^2 or |e| over all errors: one number, as SimOpt has it
///   energy, mmd, sliced-wasserstein   distance of the transitions' errors, as a set of vectors,
///                from the noise's: one number; it matters how errors are distributed, not which
///                transition has made them
/// Observed are zeros.
/// @param errors, first must outlive the problem; noise's scale and slopes are first's.
/// @throws std::invalid_argument for another name.
Problem RobotProblem(const RobotDescription& robot, WindowErrors& errors, const LaplaceFit& first,
                     const std::string& discrepancy, uint64_t seed);

/// The names above.
const std::vector<std::string>& RobotDiscrepancies();

}  // namespace plumb
