#pragma once

#include <cstdint>
#include <string>

namespace plumb {

/// Faults of a bus, see faulty.h. Probabilities are per frame, in [0, 1]; times in
/// microseconds.
struct Faults {
  /// One direction.
  struct Side {
    double loss = 0, duplicate = 0, reorder = 0, corrupt = 0;
    int64_t delay = 0, jitter = 0;
  };
  Side receive, send;
  double full = 0;    ///< of sending
  double errors = 0;  ///< of receiving
  double busoff = 0;  ///< of receiving
  uint64_t seed = 1;
};

/// Reads "loss=0.1,rx.delay=2ms,seed=7". Thread-safe.
/// @throws std::invalid_argument naming the fault that is wrong, or all that there are.
Faults ParseFaults(const std::string& text);

}  // namespace plumb
