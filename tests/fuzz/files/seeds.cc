// fuzz_seeds FOLDER: makes seeds of fuzzers, by what writes such files and messages, so that no
// change of a layout leaves them behind.

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "calibrator/live/checkpoint.h"
#include "common/config.h"
#include "common/lcm_log_writer.h"
#include "common/message_bytes.h"
#include "common/time_units.h"
#include "controller/policy.h"
#include "plumb/controller_status_t.hpp"
#include "plumb/driver_status_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "tests/calibrator/sample_findings.h"
#include "tests/fuzz/files/file_kind.h"
#include "tests/fuzz/files/input_file.h"
#include "trainer/checkpoint.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kEpisode = 1'700'000'000'000'000;  // [us]
constexpr int kSteps = 2;
constexpr size_t kLongest = 16384;  // that scripts/fuzz tries: libFuzzer cuts what is longer

// Without its head, which the fuzzer makes anew.
std::string Content(std::string_view file) {
  return std::string(CheckedContent(KindOf(file), file));
}
std::string ContentOfFile(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return Content(std::string(std::istreambuf_iterator<char>(stream), {}));
}

void Write(const fs::path& file, std::string_view content) {
  if (content.size() > kLongest) throw std::length_error(file.string() + ": too long for a seed");
  std::ofstream(file, std::ios::binary) << content;
}

// A message for message_fuzz: its number there, and what is behind its fingerprint.
template <class Message>
void WriteMessage(const fs::path& file, char number, const Message& message) {
  const std::vector<uint8_t> bytes = Encode(message);
  Write(file, number + std::string(bytes.begin() + 8, bytes.end()));
}

ParameterDistribution Lacking(const RobotDescription& robot) {
  ParameterDistribution distribution = ParameterDistribution::Prior(robot);
  distribution.iteration = 1;
  distribution.residual = std::make_shared<const Residual>(SampleResidual(robot));
  distribution.starts = {Eigen::VectorXd::Zero(2 * robot.num_velocities())};
  return distribution;
}

GaussianPolicy SmallPolicy() { return GaussianPolicy({3, {2}, 1}); }

Rollout OneTransition(const RobotDescription& robot) {
  const Eigen::VectorXd x = Eigen::VectorXd::Constant(robot.num_velocities(), 0.25);
  Transition transition{0, x, x, x, x, 0.01 * x, 0.01 * x, 0.01 * x, 0.01 * x, {}};
  transition.efforts = {{0.03, x}, {robot.task.period - 0.03, -x}};
  return {kEpisode, 0, {transition}};
}

void WriteCalibrationCheckpoint(const RobotDescription& robot, const fs::path& file) {
  const fs::path folder = file.parent_path() / "checkpoint";
  const Gaussian prior = PriorGaussian(robot);
  SimOpt::State state;
  state.iteration = 1;
  state.distribution = {{0.75, 0.25}, {prior, prior}};
  state.before = {{1}, {prior}};
  state.used = "reps";
  state.residual = Lacking(robot).residual;
  state.search.update = 1;
  state.search.points = prior.mean.replicate(1, 2);
  state.search.densities = Eigen::Vector2d(-1, -std::numeric_limits<double>::infinity());
  state.warnings = {"one"};
  state.rollouts = {OneTransition(robot)};
  state.rollouts_per_iteration = {1};
  CalibrationCheckpoint(folder, robot, 1).Save(state);
  Write(file, ContentOfFile(folder / "calibration.checkpoint") + '\n' +
                  ContentOfFile(folder / "rollout_0.checkpoint"));
  fs::remove_all(folder);
}

void WriteTrainerCheckpoint(const RobotDescription& robot, const fs::path& file) {
  Checkpoint checkpoint;
  checkpoint.iteration = 1;
  checkpoint.policy = checkpoint.best_policy = checkpoint.incumbent_policy =
      SmallPolicy().ToMessage();
  checkpoint.distribution = Lacking(robot).ToMessage();
  checkpoint.critic.parameters = Eigen::VectorXf::Ones(2);
  checkpoint.best_critic = checkpoint.critic;
  checkpoint.observations = {2, Eigen::Vector3d::Ones(), Eigen::Vector3d::Ones()};
  checkpoint.judged = true;
  checkpoint.trials = {{0, {}}};
  checkpoint.incumbent = checkpoint.incumbent_since = 0;
  checkpoint.statuses.resize(1);
  Write(file, Content(EncodeCheckpoint(checkpoint)));
}

void WritePosterior(const RobotDescription& robot, const fs::path& file) {
  Findings findings = SampleFindings(robot);
  findings.samples = findings.samples.leftCols(5).eval();
  Write(file, PosteriorJson(findings, robot, SampleProvenance()));
}

/// Every robot's every file with all that it extends, and with its URDF where toml_fuzz has it: one
/// that is new in robots/ is a seed without further ado.
void WriteRobots(const fs::path& folder) {
  for (const auto& entry : fs::recursive_directory_iterator(Robots())) {
    if (entry.path().extension() != ".toml") continue;
    const std::string file = entry.path(), robot = entry.path().parent_path().filename();
    const std::string urdf = Config::Load(file).Table("robot").String("urdf");
    Write(folder / (robot + "_" + entry.path().stem().string()),
          MergedToml(file, "robot", "urdf", robot + "/" + urdf));
  }
}

// Of an episode of kSteps steps.
void WriteLog(const RobotDescription& robot, const fs::path& file) {
  LcmLogWriter log(file);
  const int joints = robot.num_joints();
  const auto n = static_cast<size_t>(joints);
  const auto states = static_cast<int>(std::lround(robot.task.period / robot.driver.measurement));
  const int64_t period = Microseconds(robot.driver.measurement);
  for (int i = 0; i <= kSteps * states; ++i) {
    const int64_t time = kEpisode + i * period;
    robot_state_t state{};
    state.utime = time, state.sequence = i;
    state.num_positions = state.num_velocities = joints;
    state.q.assign(n, 0.001 * i), state.v.assign(n, 0.2), state.effort.assign(n, 0.5);
    state.q_sd.assign(n, 1e-4), state.v_sd.assign(n, 1e-2);
    state.valid = true;
    log.Write(time, "ROBOT_STATE_SMOOTHED", Encode(state));
    if (i % states != 0 || i == kSteps * states) continue;
    joint_command_t command{};
    command.utime = time, command.sequence = command.step = i / states;
    command.state_sequence = i;
    command.episode = kEpisode;
    command.num_joints = joints;
    command.effort.assign(n, 0.5);
    for (auto* targets : {&command.position, &command.velocity, &command.kp, &command.kd})
      targets->assign(n, std::numeric_limits<double>::quiet_NaN());
    log.Write(time, "JOINT_COMMAND", Encode(command));
  }
  controller_status_t status{};
  status.phase = controller_status_t::COMPLETE;
  status.num_episodes = status.episodes_wanted = 1;
  status.episode = {kEpisode};
  status.first_state_sequence = {0}, status.last_state_sequence = {kSteps * states};
  status.returns = status.late_rate = {-1};
  status.steps = {kSteps};
  status.fell = {0};
  const int64_t end = kEpisode + kSteps * states * period;
  log.Write(end, "CONTROLLER_STATUS", Encode(status));
  // Of other shapes: structures and texts in arrays, and an array of arrays.
  driver_status_t driver{};
  driver.utime = end, driver.robot = robot.name;
  driver.num_buses = 1, driver.buses.resize(1);
  driver.num_joints = joints, driver.joint_name.assign(n, "joint");
  driver.joint_state.assign(n, driver_status_t::ARMED);
  driver.joint_reason.resize(n), driver.drive_identity.assign(n, "firmware 0.6.10");
  for (auto* readings : {&driver.motor_temperature, &driver.drive_temperature, &driver.bus_voltage,
                         &driver.bus_current})
    readings->assign(n, 24);
  driver.num_bins = driver.num_phases = 2;
  driver.lateness = {3, 1}, driver.phase_name = {"receive", "send"};
  driver.phase_duration.assign(2, driver.lateness);
  log.Write(end, "DRIVER_STATUS", Encode(driver));
  log.Flush();
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  using namespace plumb;
  if (argc != 2) return 2;
  const fs::path folder = argv[1];
  const RobotDescription& robot = FuzzRobot();
  const auto in = [&](const char* fuzzer) {
    fs::create_directories(folder / fuzzer);
    return folder / fuzzer;
  };
  WriteRobots(in("toml"));
  WriteCalibrationCheckpoint(robot, in("calibration_checkpoint") / "made");
  WriteTrainerCheckpoint(robot, in("trainer_checkpoint") / "made");
  WriteLog(robot, in("lcm_log") / "made");
  WriteLog(robot, in("log_export") / "made");
  WritePosterior(robot, in("posterior") / "made");
  WriteMessage(in("message") / "made", 15, Lacking(robot).ToMessage());
  return 0;
}
