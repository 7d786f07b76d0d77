#pragma once

#include <cstdint>

namespace plumb {

/// Names of the trainer's streams of random numbers; the other words are the update and the
/// episode. Who evaluates a policy on kHeldOutStream meets the simulators on which a training with
/// that seed has evaluated it.
enum TrainerStream : uint32_t {
  kPolicyStream = 0x7472'0000,
  kCriticStream,
  kRolloutStream,
  kFitStream,
  kEvaluationStream,
  kHeldOutStream,
  kJudgementStream
};

}  // namespace plumb
