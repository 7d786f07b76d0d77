#pragma once

namespace plumb {

// The functions here share nothing: thread-safe.

/// The probability of more than `value`, with so many degrees of freedom.
double ChiSquaredTail(double degrees, double value);

/// The value that is exceeded with this probability.
double ChiSquaredAtTail(double degrees, double probability);

}  // namespace plumb
