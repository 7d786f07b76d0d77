#pragma once

#include "plumb/parameter_distribution_t.hpp"
#include "robot/residual.h"

namespace plumb {

// Thread-safe.

/// Writes the residual's part of the message. Numbers are rounded to single precision, which a
/// residual of FitResidual has anyway.
void WriteResidual(const Residual& residual, parameter_distribution_t* message);

/// That of a message; null if it has none. @throws std::invalid_argument naming the field that does
/// not fit the others, or is not finite.
std::shared_ptr<const Residual> ReadResidual(const parameter_distribution_t& message);

}  // namespace plumb
