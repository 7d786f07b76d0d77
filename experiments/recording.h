#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "calibrator/motion/transitions.h"
#include "controller/policy.h"
#include "experiments/loop.h"
#include "robot/description.h"

namespace plumb {

/// One of the paper's two tasks.
struct PaperTask {
  const char* name;
  const char *paper, *gym;  ///< files below robots/: the paper's robot, and gym's
};
inline constexpr PaperTask kPaperTasks[] = {{"pendulum", "pendulum/gym.toml", "pendulum/gym.toml"},
                                            {"hopper", "hopper/paper.toml", "hopper/gym.toml"}};

/// Where a robot's parameters are drawn from.
enum class Hidden {
  kPaper,  ///< [virtual_robot.hidden] of the paper's robot: 1 to 5 kg for each of five masses
  kGym,    ///< [virtual_robot.hidden] of gym's: narrow ranges about gym's masses
  kPrior,  ///< gym's robot's prior: as far off as whoever wrote it thought possible
};

std::string Key(Hidden hidden);  ///< "paper", "gym", "prior"

/// The robot of a task, with the prior that calibrations begin with.
RobotDescription LoadTask(const std::string& robots, const PaperTask& task, Hidden hidden);
std::vector<RobotDescription> LoadTasks(const std::string& robots, Hidden hidden);  ///< of both

/// Parameters of "the real robot". @return physical units, order of robot.parameters.
Eigen::VectorXd DrawHidden(const RobotDescription& robot, Hidden hidden, uint64_t seed);

/// How wrong parameters are: root mean square of their relative errors. The mass of the base, which
/// moves nothing, does not count.
double RelativeError(const RobotDescription& robot, const Eigen::VectorXd& physical,
                     const Eigen::VectorXd& hidden);

/// The motion of a policy on a robot whose parameters are drawn for each seed.
struct RobotDataset {
  RobotDescription robot;
  Eigen::VectorXd hidden;
  std::shared_ptr<Loop> loop;     ///< that has trained the policy
  std::vector<Rollout> seen;      ///< states as they are read, with noise
  std::vector<Rollout> held_out;  ///< without: to judge by
};

struct RecordingSettings {
  int updates;       ///< TRPO's, of the policy, which is trained on the prior
  int episodes;      ///< seen
  double noise = 1;  ///< of the readings, a factor
  Hidden hidden = Hidden::kPaper;
  uint64_t seed = 1;
  int threads = 0;
};

/// Trains a policy and rolls it out. Episodes are as long as the task's. @param progress told the
/// share that is done; may throw to break off.
RobotDataset Record(const RobotDescription& robot, const RecordingSettings& settings,
                    const std::function<void(double)>& progress);

}  // namespace plumb
