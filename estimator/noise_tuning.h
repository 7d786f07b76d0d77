#pragma once

#include <functional>
#include <vector>

#include "estimator/state_observer.h"
#include "robot/description.h"

namespace plumb {

/// Noise learnt from a log.
struct TunedNoise {
  std::vector<NoiseDescription> joints;  ///< as [joint.estimator] has it; NaN: it has none
  /// -2 ln of the likelihood per reading, less its constant, before and after; one each per joint.
  std::vector<double> before, after;
};

inline constexpr int kMaxPlays = 228;  ///< calls of `play`

/// Noise parameters of maximum likelihood of the innovations (the prediction-error decomposition:
/// F. Schweppe, "Evaluation of likelihood functions for Gaussian signals", IEEE Trans. Information
/// Theory 11, 1965), by a coordinate search in their logarithms with ever smaller steps, in all
/// joints at once: each joint's filter is independent of the others', but for when there may be an
/// impact. A parameter that makes no difference stays as it was. Impacts are tried where there were
/// none, too.
/// @param play gives an observer all messages of the log.
/// @throws std::invalid_argument if there are fewer than 100 readings of a joint. Thread-safe.
TunedNoise TuneNoise(const RobotDescription& robot,
                     const std::function<void(StateObserver&)>& play);

}  // namespace plumb
