#include "cli/sim.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <utility>

#include "cli/outputs.h"
#include "cli/reading_noise.h"
#include "cli/roll_out.h"
#include "common/atomic_file.h"
#include "common/time_units.h"
#include "drivers/protocols/known_protocols.h"
#include "sim/simulators.h"
#include "sim/tasks/effort_table.h"
#include "sim/view/picture.h"
#include "trainer/policy_file.h"

namespace plumb {
namespace {

constexpr int kStepsPerLook = 256;  // whether to stop
constexpr size_t kLineLength = 110;
constexpr uint32_t kReadingStream = 0x52454144;  // "READ", second word of the random streams

/// Before a long simulation rather than after it.
void RequireFiles(const SimFlags& flags, const RobotDescription& robot) {
  std::vector<std::string> inputs = FilesOf(robot);
  inputs.insert(inputs.end(), {flags.policy, flags.posterior, flags.efforts});
  RequireOutputs({flags.csv, flags.png, flags.gif}, inputs);
}

// A simulation needs no drives, but whoever has misspelt what they speak hears of it here, before
// the first launch refuses it.
void WarnOfProtocols(const RobotDescription& robot) {
  try {
    RequireProtocols(robot);
  } catch (const std::invalid_argument& error) {
    spdlog::warn("{} cannot be driven: {}", robot.name, error.what());
  }
}

/// "mass/thigh=4": gives the parameter that value. One that is not among the uncertain ones joins
/// them, for the simulator to know or to refuse.
void Set(const std::string& assignment, RobotDescription& robot) {
  const size_t equals = assignment.find('=');
  double value = NAN;
  const char* end = assignment.data() + assignment.size();
  if (equals != std::string::npos) {
    const auto [rest, error] = std::from_chars(assignment.data() + equals + 1, end, value);
    if (error != std::errc() || rest != end) value = NAN;
  }
  if (!std::isfinite(value) || equals == 0) {
    throw std::invalid_argument("--set " + assignment + ": not of the form mass/thigh=4");
  }
  const std::string name = assignment.substr(0, equals);
  std::erase_if(robot.frozen, [&](const FrozenParameter& frozen) { return frozen.name == name; });
  const int index = robot.FindParameter(name);
  if (index >= 0) {
    robot.parameters[static_cast<size_t>(index)].mean = value;
  } else {
    robot.parameters.push_back({name, "", ParameterDescription::Coordinate::kLinear, value, 1});
  }
}

/// The posterior's means instead of the prior's: where there is a residual, of the coordinates, as
/// its first draw is for these. @return the residual; null = none.
std::shared_ptr<const Residual> SetMeans(const std::string& posterior, RobotDescription& robot) {
  const ParameterDistribution simulators = ReadSimulators(posterior, robot);
  const auto& residual = simulators.residual;
  const Eigen::VectorXd means =
      residual ? robot.ToPhysical(residual->coordinates[0]) : simulators.Mean();
  for (size_t i = 0; i < robot.parameters.size(); ++i)
    robot.parameters[i].mean = means(static_cast<Eigen::Index>(i));
  return residual;
}

/// The residual's first draw, for a robot whose parameters may have been set to other values, and
/// other ones added to them.
std::shared_ptr<const Residual> First(const Residual& residual, const Eigen::VectorXd& means) {
  Residual first = residual;
  first.coordinates = {means};
  return std::make_shared<const Residual>(std::move(first));
}

Eigen::VectorXd Means(const RobotDescription& robot) {
  Eigen::VectorXd means(robot.parameters.size());
  std::transform(robot.parameters.begin(), robot.parameters.end(), means.begin(),
                 [](const ParameterDescription& parameter) { return parameter.mean; });
  return means;
}

/// @param played what --efforts has; empty = nothing.
Actor MakeActor(const SimFlags& flags, const RobotDescription& robot, const Task& task,
                const Eigen::MatrixXf& played) {
  if (played.rows() > 0) return PlayActions(played);
  if (!flags.policy.empty()) {
    return [policy = LoadPolicy(flags.policy, robot, task)](
               const Eigen::VectorXf& observation, Random&) { return policy.Mean(observation); };
  }
  return flags.random ? RandomActions(task.action_size()) : NoAction(task.action_size());
}

std::string DescribeActions(const SimFlags& flags) {
  if (!flags.efforts.empty()) return "the efforts of " + flags.efforts;
  if (flags.random) return "random actions";
  return flags.policy.empty() ? "no action" : flags.policy;
}

const char* Describe(EpisodeSummary::End end) {
  switch (end) {
    case EpisodeSummary::End::kTimeLimit:
      return "time limit";
    case EpisodeSummary::End::kTerminated:
      return "terminated by the task";
    case EpisodeSummary::End::kNotFinite:
      return "the simulation has blown up";
    case EpisodeSummary::End::kInterrupted:
      return "interrupted";
  }
  return "";
}

/// "parameters: mass/torso 3.8, ...", in lines of bearable length.
std::string DescribeParameters(const RobotDescription& robot) {
  std::string text = "parameters:", line = text;
  if (robot.parameters.empty())
    return text + " none, the robot is as its URDF and TOML tables have it\n";
  text.clear();
  for (size_t i = 0; i < robot.parameters.size(); ++i) {
    const ParameterDescription& parameter = robot.parameters[i];
    const std::string item = fmt::format(" {} {}{}", parameter.name, parameter.mean,
                                         i + 1 < robot.parameters.size() ? "," : "");
    if (line.size() + item.size() > kLineLength) {
      text += line + "\n";
      line.assign(1, ' ');
    }
    line += item;
  }
  return text + line + "\n";
}

std::string Describe(const ReadingNoise& noise) {
  if (!noise.any()) return "";
  return fmt::format("readings: noise of {} on q, {} on v\n", noise.q, noise.v);
}

/// What is simulated, as the flags have it.
struct SimSetting {
  RobotDescription robot;
  std::shared_ptr<const Residual> residual;  // null = none
  ReadingNoise noise;
  Eigen::MatrixXf played;  // what --efforts has; empty = nothing
};

SimSetting ReadSetting(const SimFlags& flags) {
  if (flags.random + !flags.policy.empty() + !flags.efforts.empty() > 1)
    throw std::invalid_argument("--policy, --efforts and --random exclude each other");
  SimSetting setting{LoadRobot(flags.robot), {}, {}, {}};
  RobotDescription& robot = setting.robot;
  for (const std::string& warning : robot.warnings) spdlog::warn(warning);
  WarnOfProtocols(robot);
  if (!flags.posterior.empty()) setting.residual = SetMeans(flags.posterior, robot);
  if (flags.urdf) robot.parameters.clear();
  for (const std::string& assignment : flags.set) Set(assignment, robot);
  setting.noise = ParseReadingNoise(flags.noise);
  RequireFiles(flags, robot);
  if (!flags.efforts.empty()) {
    setting.played = ReadEffortTable(flags.efforts, robot, *MakeTask(robot));
    robot.task.steps = static_cast<int>(setting.played.rows());
  }
  return setting;
}

std::string Describe(const SimFlags& flags, const SimSetting& setting) {
  const RobotDescription& robot = setting.robot;
  return fmt::format("{}, task {}, {}, seed {}\n", robot.name, robot.task.name,
                     DescribeActions(flags), flags.seed) +
         DescribeParameters(robot) +
         (setting.residual ? "residual: what " + flags.posterior + " has learnt that these lack\n"
                           : "") +
         Describe(setting.noise);
}

/// What is kept of the episodes.
struct SimRecord {
  std::string csv;
  std::vector<Snapshot> film;  // of the first one
  std::vector<EpisodeSummary> episodes;
};

/// Plays one after the other, each with a line that says how it ended.
/// @return false if the process is to stop before all have come to their end.
bool PlayEpisodes(Process& process, const SimFlags& flags, const SimSetting& setting,
                  Environment& environment, SimRecord& record) {
  const RobotDescription& robot = setting.robot;
  int64_t asked = 0;
  const auto stop = [&] { return ++asked % kStepsPerLook == 0 && process.stopping(); };
  std::cout << fmt::format("{:>7}  {:>6}  {:>10}  ended by\n", "episode", "steps", "return");
  for (int number = 0; number < flags.episodes; ++number) {
    if (process.stopping()) {
      std::cout << "interrupted" << std::endl;
      return false;
    }
    Random readings(flags.seed, {static_cast<uint32_t>(number), kReadingStream});
    const auto see = [&](SimulatedStep step) {
      if (setting.noise.any()) setting.noise.Add(robot, readings, step.q, step.v);
      if (!flags.csv.empty()) AppendCsv(step, record.csv);
      if (number == 0) record.film.push_back({step.time, step.true_q});
    };
    record.episodes.push_back(
        PlayEpisode(environment, robot, MakeActor(flags, robot, environment.task(), setting.played),
                    flags.seed, static_cast<uint32_t>(number), see, stop));
    const EpisodeSummary& episode = record.episodes.back();
    std::cout << fmt::format("{:>7}  {:>6}  {:>10.1f}  {}", number + 1, episode.steps, episode.sum,
                             Describe(episode.end))
              << std::endl;
    if (episode.end == EpisodeSummary::End::kInterrupted) return false;
    if (number == 0 && environment.q().allFinite())
      record.film.push_back(
          {static_cast<double>(episode.steps) * robot.task.period, environment.q()});
  }
  return true;
}

/// @param seconds that it took.
std::string DescribeSpeed(const std::vector<EpisodeSummary>& episodes, double period,
                          double seconds) {
  double steps = 0;
  for (const EpisodeSummary& episode : episodes) steps += static_cast<double>(episode.steps);
  return fmt::format("{:.1f} s simulated in {:.2f} s, {:.0f} steps per second\n", steps * period,
                     seconds, steps / seconds);
}

}  // namespace

int Simulate(Process& process, const SimFlags& flags) {
  const SimSetting setting = ReadSetting(flags);
  const RobotDescription& robot = setting.robot;
  const Eigen::VectorXd means = Means(robot);
  Environment environment(robot);
  environment.SetParameters(means);
  if (setting.residual) environment.SetResidual(First(*setting.residual, means));

  std::cout << Describe(flags, setting);
  SimRecord record{CsvHeader(robot), {}, {}};
  const int64_t begin = process.clock().Now();
  if (!PlayEpisodes(process, flags, setting, environment, record)) return 130;
  const double seconds =
      std::max(Seconds(process.clock().Now() - begin) / process.clock().scale(), 1e-6);
  std::cout << Totals(record.episodes) << "\n"
            << DescribeSpeed(record.episodes, robot.task.period, seconds);
  if (!flags.csv.empty()) WriteAtomically(flags.csv, record.csv);
  if (!flags.png.empty()) WriteAtomically(flags.png, DrawStrip(robot, record.film));
  if (!flags.gif.empty()) WriteAtomically(flags.gif, DrawFilm(robot, record.film));
  return 0;
}

}  // namespace plumb
