#include "experiments/two_payloads.h"

#include <cmath>

#include "common/gaussian.h"

namespace plumb {

Eigen::Vector2d PayloadStep(Eigen::Vector2d state, double effort, double xi) {
  constexpr double kGravity = 9.81, kLength = 0.5, kArm = 0.05, kTime = 0.05;
  constexpr int kSubsteps = 10;
  const double mass = 0.8 * std::exp(xi / 2), inertia = kArm + mass * kLength * kLength;
  for (int i = 0; i < kSubsteps; ++i) {
    state(1) +=
        kTime / kSubsteps * (effort - mass * kGravity * kLength * std::sin(state(0))) / inertia;
    state(0) += kTime / kSubsteps * state(1);
  }
  return state;
}

Eigen::Vector2d ReadPayload(const Eigen::Vector2d& state, Random& random) {
  return state + kPayloadNoise.cwiseProduct(StandardNormals(2, 1, random));
}

std::vector<PayloadTransition> RecordPayloads(int count, Random& random) {
  std::vector<PayloadTransition> transitions;
  for (int t = 0; t < count; ++t) {
    const Eigen::Vector2d state(random.Uniform(-M_PI, M_PI), random.Uniform(-2, 2));
    const double effort = random.Uniform() < 0.5 ? 3 : -3;
    const double xi = t % 5 < 2 ? kLightPayload : kHeavyPayload;
    transitions.push_back({state, ReadPayload(PayloadStep(state, effort, xi), random), effort});
  }
  return transitions;
}

}  // namespace plumb
