// How often the misspecification alarm speaks of a right model and of wrong ones, and how often
// intervals hold the truth, of all steps' posterior and of the one that is left where the alarm
// speaks (calibrator/gap/gap.h): a table for docs/diagnostics.md.
// build/bench/false_alarms [logs [first seed [how the case's name begins]]]

#include <fmt/format.h>

#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "calibrator/fit/methods.h"
#include "calibrator/gap/gap.h"
#include "calibrator/motion/csv_log.h"
#include "calibrator/motion/differences.h"
#include "common/random.h"
#include "sim/environment.h"
#include "tests/calibrator/changed_robot.h"

namespace plumb {
namespace {

struct State {
  Eigen::VectorXd q, v, action;
};
using Episode = std::vector<State>;
/// What a log says of an episode.
using Sensor = std::function<void(Episode& episode, double period, Random& random)>;

void AddNoise(Episode& episode, double sd, Random& random) {
  for (State& state : episode) {
    for (double& x : state.q) x += sd * random.Normal();
    for (double& x : state.v) x += sd * random.Normal();
  }
}

Sensor Noise(double sd) {
  return [sd](Episode& episode, double, Random& random) { AddNoise(episode, sd, random); };
}

void Round(Eigen::VectorXd& x) {
  constexpr double kCounts = 16384 / (2 * M_PI);
  for (double& entry : x) entry = std::round(entry * kCounts) / kCounts;
}

void Quantise(Episode& episode, double, Random&) {
  for (State& state : episode) Round(state.q), Round(state.v);
}

enum class Difference { kBackward, kCentral };

Sensor Differences(Difference kind, double sd, bool quantised = false) {
  return [=](Episode& episode, double period, Random& random) {
    for (State& state : episode) {
      for (double& x : state.q) x += sd * random.Normal();
      if (quantised) Round(state.q);
    }
    for (size_t k = 0; k < episode.size(); ++k) {
      const size_t from = k == 0 ? 0 : k - 1, to = kind == Difference::kCentral || k == 0
                                                       ? std::min(k + 1, episode.size() - 1)
                                                       : k;
      if (to == from) continue;
      episode[k].v = (episode[to].q - episode[from].q) / (static_cast<double>(to - from) * period);
    }
  };
}

struct Case {
  std::string name;
  const char* robot;
  int episodes;
  Sensor sensor;
  Changes wrong = {};
  std::string not_fitted = {};  // a parameter of the robot that the model takes as it is
};

std::vector<Case> Cases() {
  std::vector<Case> cases{
      {"hopper, noise 0.003", "hopper/gym.toml", 60, Noise(0.003)},
      {"hopper, noise 0.001", "hopper/gym.toml", 60, Noise(0.001)},
      {"hopper, noise 0.0003", "hopper/gym.toml", 60, Noise(0.0003)},
      {"hopper, 14 bit", "hopper/gym.toml", 60, Quantise},
      {"double pendulum, noise 0.001", "double_pendulum", 3, Noise(0.001)},
      {"cart-pole, noise 0.001", "cartpole", 3, Noise(0.001)},
      {"pendulum, noise 0.001", "pendulum", 5, Noise(0.001)},
      {"double pendulum, central differences, 0.001", "double_pendulum", 3,
       Differences(Difference::kCentral, 0.001)},
      {"double pendulum, backward differences, 14 bit", "double_pendulum", 3,
       Differences(Difference::kBackward, 0, true)},
      {"cart-pole, central differences, 0.001", "cartpole", 3,
       Differences(Difference::kCentral, 0.001)},
      {"hopper, central differences, 0.0003", "hopper/gym.toml", 60,
       Differences(Difference::kCentral, 0.0003)},
      {"hopper, backward differences, 14 bit", "hopper/gym.toml", 60,
       Differences(Difference::kBackward, 0, true)},
  };
  const Changes large{{"inertia/torso", 1.2},   {"inertia/thigh", 1.2},     {"inertia/leg", 1.2},
                      {"inertia/foot", 1.2},    {"friction/leg", 5},        {"delay/thigh", 0.002},
                      {"gravity", 9.81 * 1.02}, {"contact/stiffness", 7500}};
  for (const double noise : {0.003, 0.0003}) {
    for (const auto& fault : large) {
      cases.push_back({fmt::format("wrong {}, noise {}", fault.first, noise),
                       "hopper/gym.toml",
                       60,
                       Noise(noise),
                       {fault}});
    }
  }
  const Changes small{{"inertia/leg", 1.05}, {"gain/leg", 1.02}, {"armature/leg", 1.02}};
  for (const auto& fault : small) {
    cases.push_back({fmt::format("slightly wrong {}, noise 0.0003", fault.first),
                     "hopper/gym.toml",
                     60,
                     Noise(0.0003),
                     {fault}});
  }
  cases.push_back({"slightly wrong mass/torso, not fitted, noise 0.0003",
                   "hopper/gym.toml",
                   60,
                   Noise(0.0003),
                   {{"mass/torso", 3.665 * 1.02}},
                   "mass/torso"});
  const Changes pendulum{
      {"gravity", 9.81 * 1.01}, {"delay/shoulder", 0.003}, {"length/upper", 1.02}};
  for (const auto& fault : pendulum) {
    cases.push_back({fmt::format("double pendulum, wrong {}, noise 0.0003", fault.first),
                     "double_pendulum",
                     3,
                     Noise(0.0003),
                     {fault}});
  }
  return cases;
}

std::vector<Episode> Motion(const Case& one, const RobotDescription& fitted, uint64_t seed) {
  const auto [robot, physical] = Change(fitted, one.wrong, seed);
  Environment environment(robot);
  environment.SetParameters(physical);
  Random random(seed, {7});
  std::vector<Episode> episodes;
  for (int e = 0; e < one.episodes; ++e) {
    environment.Reset(random);
    Episode episode;
    for (int step = 0; step < robot.task.steps; ++step) {
      Eigen::VectorXf action(environment.action_size());
      for (float& a : action) a = static_cast<float>(random.Uniform(-1, 1));
      const Eigen::VectorXd q = environment.reading_q(), v = environment.reading_v();
      const StepResult result = environment.Step(action);
      Eigen::VectorXd u(environment.action_size());
      for (Eigen::Index i = 0; i < u.size(); ++i)
        u(i) = environment.effort()(environment.task().action_indices()[static_cast<size_t>(i)]) /
               environment.task().action_unit(static_cast<int>(i));
      episode.push_back({q, v, u});
      if (result.terminated) break;
    }
    episodes.push_back(std::move(episode));
  }
  return episodes;
}

Log Recorded(const Case& one, const RobotDescription& robot, uint64_t seed) {
  std::string csv = "t";
  for (const char* kind : {"q/", "v/"}) {
    for (const JointDescription& joint : robot.joints) csv += std::string(",") + kind + joint.name;
  }
  for (const JointDescription& joint : robot.joints) {
    if (!joint.passive && joint.effort_limit > 0) csv += ",u/" + joint.name;
  }
  csv += ",truncated\n";
  Random random(seed, {8});
  for (Episode& episode : [&] { return Motion(one, robot, seed); }()) {
    one.sensor(episode, robot.task.period, random);
    for (size_t k = 0; k < episode.size(); ++k) {
      csv += fmt::format("{}", static_cast<double>(k) * robot.task.period);
      for (const Eigen::VectorXd* x : {&episode[k].q, &episode[k].v, &episode[k].action}) {
        for (const double entry : *x) csv += fmt::format(",{}", entry);
      }
      csv += k + 1 == episode.size() ? ",1\n" : ",0\n";
    }
  }
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / fmt::format("false_alarms.{}.csv", getpid());
  std::ofstream(file) << csv;
  Log log = ReadCsvLog(file, robot);
  std::filesystem::remove(file);
  return log;
}

struct Outcome {
  int logs = 0, alarms = 0, judged = 0, intervals = 0, held = 0;
  // of the posterior that is left: of what informs the parameters, and by how many logs
  int left = 0, left_held = 0, beside = 0, free = 0, nothing = 0;
  double fit = 0, test = 0;  // [s]
};

// How many intervals hold the truth.
int Held(const RobotDescription& robot, const Gaussian& posterior, uint64_t seed) {
  const Eigen::VectorXd truth = HiddenParameters(robot, seed);
  int held = 0;
  for (Eigen::Index i = 0; i < truth.size(); ++i) {
    const ParameterDescription& parameter = robot.parameters[static_cast<size_t>(i)];
    const bool log_scale = parameter.coordinate == ParameterDescription::Coordinate::kLog;
    const double off = posterior.mean(i) - (log_scale ? std::log(truth(i)) : truth(i));
    held += std::abs(off) < 1.96 * std::sqrt(posterior.covariance(i, i));
  }
  return held;
}

void Run(const Case& one, uint64_t seed, Outcome* outcome) {
  RobotDescription robot = LoadRobot(std::string(PLUMBLINE_SOURCE) + "/robots/" + one.robot);
  std::erase_if(robot.parameters, [&](const ParameterDescription& parameter) {
    return parameter.name == one.not_fitted;
  });
  std::erase_if(robot.virtual_robot.hidden,
                [&](const HiddenParameter& hidden) { return hidden.name == one.not_fitted; });
  Log log = Recorded(one, robot, seed);
  ForgetVelocities(robot, log.differenced, &log.rollouts);
  const auto begin = std::chrono::steady_clock::now();
  CalibrationOptions options;
  options.method = "laplace";
  const auto model = std::make_shared<const Model>(robot);
  const MethodInput input{model, log.rollouts, options};
  MethodResult result = RunMethod(input);
  const auto fitted = std::chrono::steady_clock::now();
  const auto parameters = static_cast<int>(robot.parameters.size());
  outcome->held += Held(robot, Moments(result.posterior), seed);
  outcome->intervals += parameters;
  const GapFit gap = CloseGap(input, std::move(result));
  outcome->judged += gap.alarm.judged;
  outcome->beside += gap.gap.informed == Informed::kBesideContacts;
  outcome->free += gap.gap.informed == Informed::kFree;
  outcome->nothing += gap.gap.informed == Informed::kNone;
  if (gap.gap.informed != Informed::kNone) {
    outcome->left += parameters;
    outcome->left_held += Held(robot, Moments(gap.result.posterior), seed);
  }
  const std::chrono::duration<double> fit = fitted - begin,
                                      test = std::chrono::steady_clock::now() - fitted;
  outcome->fit += fit.count(), outcome->test += test.count();
  ++outcome->logs, outcome->alarms += gap.alarm.alarm;
  fmt::print(stderr, "{}, seed {}: {} {}\n", one.name, seed, gap.alarm.alarm ? "ALARM" : "quiet",
             gap.alarm.summary);
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  using namespace plumb;
  const int logs = argc > 1 ? std::atoi(argv[1]) : 40;
  const int first = argc > 2 ? std::atoi(argv[2]) : 1;
  const std::string only = argc > 3 ? argv[3] : "";
  fmt::print(
      "| log | alarms | intervals that hold the truth | informed by all, beside contacts, free "
      "steps, nothing | intervals then | [s] to fit | to test |\n|---|---|---|---|---|---|---|\n");
  for (const Case& one : Cases()) {
    if (!one.name.starts_with(only)) continue;
    Outcome outcome;
    for (int log = 0; log < logs; ++log) Run(one, static_cast<uint64_t>(first + log), &outcome);
    fmt::print("| {} | {} | {} of {} | {}, {}, {}, {} | {} of {} | {:.1f} | {:.1f} |\n", one.name,
               outcome.judged == 0 ? "not judged"
                                   : fmt::format("{} of {}", outcome.alarms, outcome.judged),
               outcome.held, outcome.intervals,
               outcome.judged - outcome.beside - outcome.free - outcome.nothing, outcome.beside,
               outcome.free, outcome.nothing, outcome.left_held, outcome.left, outcome.fit / logs,
               outcome.test / logs);
    std::fflush(stdout);
  }
}
