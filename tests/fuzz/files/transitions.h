#pragma once

#include <vector>

#include "calibrator/motion/transitions.h"
#include "tests/fuzz/bytes.h"

namespace plumb {

/// What a calibration relies on: states to begin with and efforts are finite; an entry that was not
/// observed may be nan.
inline void RequireFinite(const std::vector<Rollout>& rollouts) {
  for (const Rollout& rollout : rollouts) {
    for (const Transition& t : rollout.transitions) {
      Require(t.q.allFinite() && t.v.allFinite());
      Require(!t.next_q.array().isInf().any() && !t.next_v.array().isInf().any());
      for (const auto& piece : t.efforts) Require(piece.effort.allFinite());
    }
  }
}

}  // namespace plumb
