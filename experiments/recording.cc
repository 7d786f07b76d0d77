#include "experiments/recording.h"

#include <cmath>
#include <filesystem>

#include "experiments/simulated_system.h"
#include "sim/parameters.h"

namespace plumb {
namespace {

constexpr int kHeldOut = 5;  // episodes
constexpr uint32_t kHiddenStream = 0x41dde4;
constexpr uint32_t kHeldOutFirst = 1000;  // number of the first of them

}  // namespace

std::string Key(Hidden hidden) {
  switch (hidden) {
    case Hidden::kPaper:
      return "paper";
    case Hidden::kGym:
      return "gym";
    case Hidden::kPrior:
      return "prior";
  }
  return "";
}

RobotDescription LoadTask(const std::string& robots, const PaperTask& task, Hidden hidden) {
  const char* file = hidden == Hidden::kPaper ? task.paper : task.gym;
  return LoadRobot((std::filesystem::path(robots) / file).string());
}

std::vector<RobotDescription> LoadTasks(const std::string& robots, Hidden hidden) {
  std::vector<RobotDescription> tasks;
  for (const PaperTask& task : kPaperTasks) tasks.push_back(LoadTask(robots, task, hidden));
  return tasks;
}

Eigen::VectorXd DrawHidden(const RobotDescription& robot, Hidden hidden, uint64_t seed) {
  if (hidden != Hidden::kPrior) return HiddenParameters(robot, seed);
  Random random(seed, {kHiddenStream});
  return ParameterDistribution::Prior(robot).Sample(random);
}

double RelativeError(const RobotDescription& robot, const Eigen::VectorXd& physical,
                     const Eigen::VectorXd& hidden) {
  Eigen::ArrayXd errors = physical.array() / hidden.array() - 1;
  double count = static_cast<double>(errors.size());
  if (const int base = robot.FindParameter("mass/" + robot.links[0].name); base >= 0)
    errors(base) = 0, --count;
  return std::sqrt(errors.square().sum() / count);
}

RobotDataset Record(const RobotDescription& robot, const RecordingSettings& settings,
                    const std::function<void(double)>& progress) {
  RobotDataset recording{robot, DrawHidden(robot, settings.hidden, settings.seed), nullptr, {}, {}};
  recording.loop = std::make_shared<Loop>(robot, recording.hidden);
  LoopSettings first;
  first.seed = settings.seed;
  first.threads = settings.threads;
  first.first_updates = settings.updates;
  const auto trainer = recording.loop->TrainFirst(
      Key(CalibrationStrategy::kPrior), ParameterDistribution::Prior(robot), first, progress);
  const Eigen::VectorXd noise = settings.noise * ReadingNoise(robot);
  SimulatedSystem read(robot, recording.hidden, noise, settings.seed),
      exact(robot, recording.hidden, 0 * noise, settings.seed);
  for (int i = 0; i < settings.episodes; ++i) {
    recording.seen.push_back(
        read.Run(trainer->policy(), true, robot.task.steps, static_cast<uint32_t>(i)).rollout);
  }
  for (uint32_t i = 0; i < kHeldOut; ++i) {
    recording.held_out.push_back(
        exact.Run(trainer->policy(), true, robot.task.steps, kHeldOutFirst + i).rollout);
  }
  return recording;
}

}  // namespace plumb
