#include "cli/excite.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <vector>

#include "calibrator/design/excitation.h"
#include "cli/outputs.h"
#include "common/atomic_file.h"
#include "robot/description.h"
#include "sim/simulators.h"
#include "sim/tasks/task.h"
#include "sim/view/picture.h"

namespace plumb {
namespace {

constexpr size_t kMaxRows = 10;

std::string DescribeStart(const RobotDescription& robot, uint64_t seed) {
  const auto [q, v] = ExcitationStart(robot, seed);
  std::vector<std::string> joints;
  for (int i = 0; i < robot.num_joints(); ++i) {
    const JointDescription& joint = robot.joints[static_cast<size_t>(i)];
    joints.push_back(
        fmt::format("{} {:.4g} (speed {:.3g})", joint.name,
                    fmt::join(q.segment(robot.position_of(i), joint.num_positions()), " "),
                    fmt::join(v.segment(robot.velocity_of(i), joint.num_velocities()), " ")));
  }
  return fmt::format("it begins at {}", fmt::join(joints, ", "));
}

std::string Table(const RobotDescription& robot, const std::vector<RatedExcitation>& rated) {
  std::string text =
      fmt::format("{:<44}{:>12}{:>9}{:>9}\n", "excitation", "gain [nat]", "s", "margin");
  for (size_t i = 0; i < std::min(rated.size(), kMaxRows); ++i) {
    text += fmt::format("{:<44}{:>12.2f}{:>9.2f}{:>7.0f} %\n", rated[i].excitation.name,
                        rated[i].gain, rated[i].steps * robot.task.period, 100 * rated[i].margin);
  }
  return text;
}

std::string Expected(const RobotDescription& robot, const Gaussian& prior,
                     const RatedExcitation& best) {
  const Eigen::VectorXd before =
      PhysicalSd(robot, prior.mean, prior.covariance.diagonal().cwiseSqrt());
  const Eigen::VectorXd after = PhysicalSd(robot, prior.mean, best.sd);
  std::string text = fmt::format("{:<28}{:>12}{:>14}\n", "parameter", "present sd", "expected sd");
  for (Eigen::Index i = 0; i < before.size(); ++i) {
    const ParameterDescription& parameter = robot.parameters[static_cast<size_t>(i)];
    text += fmt::format("{:<28}{:>12.3g}{:>14.3g} {}\n", parameter.name, before(i), after(i),
                        parameter.unit);
  }
  return text;
}

std::string Csv(const RobotDescription& robot, const RatedExcitation& best) {
  const auto task = MakeTask(robot);
  const Eigen::VectorXd limits = robot.effort_limits();
  std::string csv = "t";
  for (const std::string& joint : task->action_names()) csv += ",u/" + joint;
  csv += "\n";
  for (Eigen::Index k = 0; k < best.steps; ++k) {
    csv += fmt::format("{:.17g}", static_cast<double>(k) * robot.task.period);
    for (int i = 0; i < task->action_size(); ++i) {
      csv +=
          fmt::format(",{:.17g}", best.excitation.action(k, i) * limits(i) / task->action_unit(i));
    }
    csv += "\n";
  }
  return csv;
}

std::vector<Snapshot> Film(const RobotDescription& robot, const RatedExcitation& best) {
  std::vector<Snapshot> film;
  for (Eigen::Index k = 0; k <= best.steps; ++k) {
    film.push_back({static_cast<double>(k) * robot.task.period, best.q.col(k)});
  }
  return film;
}

}  // namespace

int Excite(const ExciteFlags& flags) {
  const RobotDescription robot = LoadRobot(flags.robot);
  for (const std::string& warning : robot.warnings) spdlog::warn(warning);
  std::vector<std::string> inputs = FilesOf(robot);
  inputs.push_back(flags.posterior);
  RequireOutputs({flags.output, flags.png}, inputs);
  ExcitationSettings settings;
  settings.candidates = flags.candidates;
  settings.seconds = flags.seconds;
  settings.seed = flags.seed;
  settings.one_by_one = flags.one_by_one;
  const Gaussian prior = flags.posterior.empty()
                             ? PriorGaussian(robot)
                             : Moments(ReadSimulators(flags.posterior, robot).mixture);
  const std::vector<RatedExcitation> rated = RateExcitations(robot, prior, settings);
  std::cout << fmt::format("{}, task {}, seed {}: {} of {} excitations keep within the limits\n",
                           robot.name, robot.task.name, flags.seed, rated.size(), flags.candidates);
  if (rated.empty()) {
    std::cerr << "plumb: no excitation that was tried keeps within the robot's limits" << std::endl;
    return 1;
  }
  const RatedExcitation& best = rated[0];
  std::cout << Table(robot, rated) << Expected(robot, prior, best)
            << fmt::format("{} {}; {}\n", best.excitation.name, DescribeGain(robot, prior, best),
                           DescribeStart(robot, flags.seed));
  WriteAtomically(flags.output, Csv(robot, best));
  if (!flags.png.empty()) WriteAtomically(flags.png, DrawStrip(robot, Film(robot, best)));
  return 0;
}

}  // namespace plumb
