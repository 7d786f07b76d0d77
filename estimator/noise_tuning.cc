#include "estimator/noise_tuning.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "common/special_numbers.h"
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

class NoiseSearch {
 public:
  NoiseSearch(const RobotDescription& robot, const std::function<void(StateObserver&)>& play)
      : robot_(robot), play_(play), tried_(robot), has_velocity_(robot.joints.size(), false) {}

  TunedNoise Find() {
    const std::vector<NoiseDescription> given = NoiseOf(robot_);
    tuned_.joints = given;
    tuned_.before = Deviances(given);
    for (const Parameter impact : kImpacts) {
      for (NoiseDescription& joint : tuned_.joints) {
        if (joint.*impact == 0) joint.*impact = kFirstImpact;
      }
    }
    tuned_.after = Deviances(tuned_.joints);
    for (const double factor : kFactors) {
      for (int round = 0; round < kRounds && Step(factor); ++round) {
      }
    }
    for (const Parameter impact : kImpacts) LeaveOut(impact, given);
    for (size_t i = 0; i < size(); ++i) {
      if (robot_.joints[i].passive) tuned_.joints[i].coupling = kNaN;
      if (!has_velocity_[i]) tuned_.joints[i].velocity_sd = kNaN;
      tuned_.joints[i].delay = robot_.joints[i].noise.delay;
    }
    return std::move(tuned_);
  }

 private:
  size_t size() const { return robot_.joints.size(); }

  // Per reading of each joint.
  std::vector<double> Deviances(const std::vector<NoiseDescription>& noise) {
    for (size_t i = 0; i < size(); ++i) tried_.joints[i].noise = noise[i];
    StateObserver observer(tried_);
    play_(observer);
    const estimator_status_t status = observer.Status();
    std::vector<double> per_reading;
    for (size_t i = 0; i < size(); ++i) {
      const int64_t readings = observer.readings(static_cast<int>(i));
      // nothing to learn: no trial is better than another
      if (observer.of_base(static_cast<int>(i))) {
        per_reading.push_back(0);
        continue;
      }
      if (readings < kFewest) {
        throw std::invalid_argument(
            fmt::format("joint {}: {} readings are too few to learn noise from: at least {}",
                        robot_.joints[i].name, readings, kFewest));
      }
      has_velocity_[i] = std::isfinite(status.velocity_nis[i]);
      per_reading.push_back(observer.deviance(static_cast<int>(i)) / static_cast<double>(readings));
    }
    return per_reading;
  }

  // Each parameter by a factor, up or down, of each joint by itself. @return whether any is better.
  bool Step(double factor) {
    bool better = false;
    for (const Parameter parameter : kParameters) {
      std::vector<bool> found(size(), false);
      for (const double step : {factor, 1 / factor}) {
        std::vector<NoiseDescription> candidate = tuned_.joints;
        for (size_t i = 0; i < size(); ++i) {
          if (!found[i]) candidate[i].*parameter *= step;
          candidate[i].coupling = std::min(1.0, candidate[i].coupling);
        }
        const std::vector<double> deviance = Deviances(candidate);
        for (size_t i = 0; i < size(); ++i) {
          if (found[i] || !(deviance[i] < tuned_.after[i] - kWorthwhile)) continue;
          found[i] = better = true;
          Take(i, candidate, deviance);
        }
      }
    }
    return better;
  }

  // A kind of noise that was absent and is not worth having stays absent.
  void LeaveOut(Parameter impact, const std::vector<NoiseDescription>& given) {
    std::vector<NoiseDescription> candidate = tuned_.joints;
    for (size_t i = 0; i < size(); ++i) {
      if (given[i].*impact == 0) candidate[i].*impact = 0;
    }
    const std::vector<double> deviance = Deviances(candidate);
    for (size_t i = 0; i < size(); ++i) {
      if (deviance[i] < tuned_.after[i] + kWorthwhile) Take(i, candidate, deviance);
    }
  }

  void Take(size_t joint, const std::vector<NoiseDescription>& candidate,
            const std::vector<double>& deviance) {
    tuned_.joints[joint] = candidate[joint];
    tuned_.after[joint] = deviance[joint];
  }

  const RobotDescription& robot_;
  const std::function<void(StateObserver&)>& play_;
  RobotDescription tried_;
  std::vector<bool> has_velocity_;
  TunedNoise tuned_;
};

}  // namespace

TunedNoise TuneNoise(const RobotDescription& robot,
                     const std::function<void(StateObserver&)>& play) {
  return NoiseSearch(robot, play).Find();
}

}  // namespace plumb
