#pragma once

#include <span>

namespace plumb {

/// Replaces each x <= 0 by e^x, to 1e-12 of its value, with the same bits on any processor, which a
/// library's have not: x = k ln 2 + r, Taylor's series of e^r to the 10th power, 2^k by its bits.
/// Below -700 it is e^-700. Thread-safe.
void ExpOfNegatives(std::span<double> x);

}  // namespace plumb
