#include "calibrator/design/excitation_signals.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>

#include "common/random.h"

namespace plumb {
namespace {

constexpr uint32_t kStream = 0x45584349;  // "EXCI"
constexpr double kAmplitudes[] = {1, 0.5, 0.25};
constexpr double kBandwidths[] = {0.25, 0.08, 0.025, 0.008};  // cycles per control step
constexpr int kSines = 8;

enum class Wave { kSteps, kBangBang, kMultisine, kChirp, kImpulses };
constexpr const char* kNames[] = {"random steps", "bang-bang", "multisine", "chirp", "impulses"};

using Signal = Eigen::VectorXd;

Signal Held(int steps, double bandwidth, bool bang_bang, Random& random) {
  const int hold = std::max(1, static_cast<int>(std::lround(0.5 / bandwidth)));
  Signal signal(steps);
  double value = 0;
  for (int k = 0, left = 0; k < steps; ++k, --left) {
    if (left == 0) {
      // Not in time with each other: hold for one to two half periods.
      left = hold + static_cast<int>(random.Uniform(0, hold));
      value = random.Uniform(-1, 1);
      if (bang_bang) value = value < 0 ? -1 : 1;
    }
    signal(k) = value;
  }
  return signal;
}

// Of random phases, with frequencies up to the bandwidth, scaled to reach 1.
Signal Multisine(int steps, double bandwidth, Random& random) {
  Signal signal = Signal::Zero(steps);
  for (int i = 1; i <= kSines; ++i) {
    const double frequency = bandwidth * (i - random.Uniform(0, 0.5)) / kSines;
    const double phase = random.Uniform(0, 2 * std::numbers::pi);
    for (int k = 0; k < steps; ++k)
      signal(k) += std::sin(2 * std::numbers::pi * frequency * k + phase);
  }
  return signal / std::max(signal.cwiseAbs().maxCoeff(), 1e-9);
}

// From a twentieth of the bandwidth up to it.
Signal Chirp(int steps, double bandwidth, Random& random) {
  const double phase = random.Uniform(0, 2 * std::numbers::pi), low = 0.05 * bandwidth;
  return Signal::NullaryExpr(steps, [&](Eigen::Index k) {
    const auto t = static_cast<double>(k);
    const double turns = low * t + (bandwidth - low) * t * t / (2 * std::max(steps, 1));
    return std::sin(2 * std::numbers::pi * turns + phase);
  });
}

// One control step of full effort of either sign, on average once per half period.
Signal Impulses(int steps, double bandwidth, Random& random) {
  Signal signal = Signal::Zero(steps);
  for (double& value : signal) {
    const double chance = random.Uniform();
    if (chance < 2 * bandwidth) value = chance < bandwidth ? -1 : 1;
  }
  return signal;
}

Signal Make(Wave shape, int steps, double bandwidth, Random& random) {
  switch (shape) {
    case Wave::kSteps:
      return Held(steps, bandwidth, /*bang_bang=*/false, random);
    case Wave::kBangBang:
      return Held(steps, bandwidth, /*bang_bang=*/true, random);
    case Wave::kMultisine:
      return Multisine(steps, bandwidth, random);
    case Wave::kChirp:
      return Chirp(steps, bandwidth, random);
    case Wave::kImpulses:
      return Impulses(steps, bandwidth, random);
  }
  return {};
}

}  // namespace

std::vector<Excitation> MakeExcitations(const RobotDescription& robot,
                                        const ExcitationSettings& settings) {
  const int steps =
      std::max(1, static_cast<int>(std::lround(settings.seconds / robot.task.period)));
  const auto joints = static_cast<Eigen::Index>(robot.driven().size());
  // The part of the time in which a joint moves.
  const auto begin = [&](Eigen::Index i) { return settings.one_by_one ? i * steps / joints : 0; };
  const auto count = [&](Eigen::Index i) {
    return settings.one_by_one ? begin(i + 1) - begin(i) : steps;
  };
  std::vector<Excitation> excitations;
  for (int c = 0; c < settings.candidates; ++c) {
    Random random(settings.seed, {static_cast<uint32_t>(c), kStream});
    Eigen::MatrixXd action = Eigen::MatrixXd::Zero(steps, joints);
    if (c == 0) {
      for (Eigen::Index k = 0; k < steps; ++k) {
        for (Eigen::Index i = 0; i < joints; ++i) {
          const double drawn = random.Uniform(-1, 1);
          if (k >= begin(i) && k < begin(i) + count(i)) action(k, i) = drawn;
        }
      }
      excitations.push_back({"the task's random actions", action});
      continue;
    }
    const size_t number = static_cast<size_t>(c - 1);
    const auto shape = static_cast<Wave>(number % std::size(kNames));
    const double amplitude = kAmplitudes[number / std::size(kNames) % std::size(kAmplitudes)];
    const double bandwidth =
        kBandwidths[number / std::size(kNames) / std::size(kAmplitudes) % std::size(kBandwidths)];
    for (Eigen::Index i = 0; i < joints; ++i) {
      // Joints that all did the same could not be told apart.
      const double own_amplitude = i == 0 ? amplitude : amplitude * random.Uniform(0.5, 1);
      const double own_bandwidth = i == 0 ? bandwidth : bandwidth * random.Uniform(0.5, 1);
      action.col(i).segment(begin(i), count(i)) =
          own_amplitude * Make(shape, static_cast<int>(count(i)), own_bandwidth, random);
    }
    excitations.push_back(
        {fmt::format("{} up to {:.2g} Hz, {:.0f} % effort", kNames[static_cast<size_t>(shape)],
                     bandwidth / robot.task.period, 100 * amplitude),
         std::move(action)});
  }
  return excitations;
}

}  // namespace plumb
