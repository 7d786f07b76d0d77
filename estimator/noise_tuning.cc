#include "estimator/noise_tuning.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "robot/motion_noise.h"

namespace plumb {
namespace {

constexpr double kFactors[] = {3, 1.5, 1.2, 1.07};
constexpr int kRounds = 4;            // with each factor at most
constexpr double kWorthwhile = 1e-4;  // of the deviance per reading
constexpr int64_t kFewest = 100;      // readings

using Parameter = double NoiseDescription::*;
// Causes of steps first: jerk can stand in for them, but not the other way round.
constexpr Parameter kParameters[] = {
    &NoiseDescription::ground_impact, &NoiseDescription::stop_impact,
    &NoiseDescription::jerk,          &NoiseDescription::velocity_sd,
    &NoiseDescription::effort_step,   &NoiseDescription::position_sd,
    &NoiseDescription::coupling};
constexpr Parameter kImpacts[] = {&NoiseDescription::ground_impact, &NoiseDescription::stop_impact};
// As it is, with impacts, both directions of each parameter, without impacts.
static_assert(2 + std::size(kFactors) * kRounds * std::size(kParameters) * 2 +
                  std::size(kImpacts) ==
              kMaxPlays);
// [1/s] Where the search for an impact begins if there was none: 10 kg that meet 100 N s/m.
constexpr double kFirstImpact = 10;

std::vector<NoiseDescription> NoiseOf(const RobotDescription& robot) {
  std::vector<NoiseDescription> noise;
  for (int i = 0; i < robot.num_joints(); ++i) {
    const EstimatorSettings s = EstimatorOf(robot, i);
    noise.push_back({s.position_sd, s.velocity_sd, s.jerk, s.effort_step, s.ground_impact,
                     s.stop_impact, s.coupling, s.delay});
  }
  return noise;
}

}  // namespace

TunedNoise TuneNoise(const RobotDescription& robot,
                     const std::function<void(StateObserver&)>& play) {
  const auto n = static_cast<size_t>(robot.num_joints());
  RobotDescription tried = robot;
  std::vector<bool> has_velocity(n, false);
  const auto deviances = [&](const std::vector<NoiseDescription>& noise) {
    for (size_t i = 0; i < n; ++i) tried.joints[i].noise = noise[i];
    StateObserver observer(tried);
    play(observer);
    const estimator_status_t status = observer.Status();
    std::vector<double> per_reading;
    for (size_t i = 0; i < n; ++i) {
      const int64_t readings = observer.readings(static_cast<int>(i));
      // nothing to learn: no trial is better than another
      if (observer.of_base(static_cast<int>(i))) {
        per_reading.push_back(0);
        continue;
      }
      if (readings < kFewest) {
        throw std::invalid_argument(
            fmt::format("joint {}: {} readings are too few to learn noise from: at least {}",
                        robot.joints[i].name, readings, kFewest));
      }
      has_velocity[i] = std::isfinite(status.velocity_nis[i]);
      per_reading.push_back(observer.deviance(static_cast<int>(i)) / static_cast<double>(readings));
    }
    return per_reading;
  };

  TunedNoise tuned;
  tuned.joints = NoiseOf(robot);
  tuned.before = deviances(tuned.joints);
  const std::vector<NoiseDescription> given = tuned.joints;
  for (const Parameter impact : kImpacts) {
    for (NoiseDescription& joint : tuned.joints) {
      if (joint.*impact == 0) joint.*impact = kFirstImpact;
    }
  }
  tuned.after = deviances(tuned.joints);
  for (const double factor : kFactors) {
    bool better = true;
    for (int round = 0; better && round < kRounds; ++round) {
      better = false;
      for (const Parameter parameter : kParameters) {
        std::vector<bool> found(n, false);
        for (const double step : {factor, 1 / factor}) {
          std::vector<NoiseDescription> candidate = tuned.joints;
          for (size_t i = 0; i < n; ++i) {
            if (!found[i]) candidate[i].*parameter *= step;
            candidate[i].coupling = std::min(1.0, candidate[i].coupling);
          }
          const std::vector<double> deviance = deviances(candidate);
          for (size_t i = 0; i < n; ++i) {
            if (found[i] || !(deviance[i] < tuned.after[i] - kWorthwhile)) continue;
            found[i] = better = true;
            tuned.joints[i] = candidate[i];
            tuned.after[i] = deviance[i];
          }
        }
      }
    }
  }
  // A kind of noise that was absent and is not worth having stays absent.
  for (const Parameter impact : kImpacts) {
    std::vector<NoiseDescription> candidate = tuned.joints;
    for (size_t i = 0; i < n; ++i) {
      if (given[i].*impact == 0) candidate[i].*impact = 0;
    }
    const std::vector<double> deviance = deviances(candidate);
    for (size_t i = 0; i < n; ++i) {
      if (!(deviance[i] < tuned.after[i] + kWorthwhile)) continue;
      tuned.joints[i] = candidate[i];
      tuned.after[i] = deviance[i];
    }
  }
  for (size_t i = 0; i < n; ++i) {
    if (robot.joints[i].passive)
      tuned.joints[i].coupling = std::numeric_limits<double>::quiet_NaN();
    if (!has_velocity[i]) tuned.joints[i].velocity_sd = std::numeric_limits<double>::quiet_NaN();
    tuned.joints[i].delay = robot.joints[i].noise.delay;
  }
  return tuned;
}

}  // namespace plumb
