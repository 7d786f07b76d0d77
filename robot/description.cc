#include "robot/description.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "common/config.h"
#include "robot/urdf.h"

namespace plumb {
namespace {

constexpr Range kAtLeastOne{1, 1e9};

DriverSettings ReadDriver(Config config) {
  DriverSettings s;
  s.cycle = config.Number("cycle", {1e-4, 1});
  s.measurement = config.Number("measurement", {1e-4, 1});
  s.expiry = config.Number("expiry", {1e-3, 1});
  s.disarm_after = config.Number("disarm_after", {1e-3, 10});
  s.stale_after = config.Number("stale_after", {1e-3, 1});
  s.heartbeat_timeout = config.Number("heartbeat_timeout", {1e-3, 10});
  s.start_guard = config.Number("start_guard", {0, 10});
  if (s.expiry < 2 * s.cycle) config.Fail("expiry", "must be at least two cycles");
  if (s.disarm_after < s.expiry) config.Fail("disarm_after", "must not be shorter than expiry");
  if (s.stale_after < 2 * s.measurement) config.Fail("stale_after", "must be at least two measurement periods");
  config.Finish();
  return s;
}

EstimatorSettings ReadEstimator(Config config) {
  EstimatorSettings s;
  s.position_sd = config.Number("position_sd", kPositive);
  s.velocity_sd = config.Number("velocity_sd", kPositive);
  s.jerk = config.Number("jerk", kPositive);
  s.effort_step = config.Number("effort_step", kNotNegative);
  s.timing_sd = config.Number("timing_sd", kNotNegative);
  s.lag = config.Integer("lag", {1, 1000});
  s.reset_after = config.Number("reset_after", kPositive);
  config.Finish();
  return s;
}

SimulationSettings ReadSimulation(Config config, double period) {
  SimulationSettings s;
  s.integrator = config.Choice("integrator", {"semi-implicit", "leapfrog"}) == 0
                     ? SimulationSettings::Integrator::kSemiImplicit
                     : SimulationSettings::Integrator::kLeapfrog;
  s.substep = config.Number("substep", {1e-6, 1});
  s.latency = config.Number("latency", kNotNegative, 0);
  s.speed_clip = config.Number("speed_clip", {std::numeric_limits<double>::min()}, HUGE_VAL);
  s.move_before_clip = config.Boolean("move_before_clip", false);
  if (s.substep > period * (1 + 1e-9)) config.Fail("substep", "must not be longer than task.period");
  if (s.latency >= period) config.Fail("latency", "must be shorter than task.period");
  config.Finish();
  return s;
}

std::vector<ParameterDescription> ReadParameters(Config& root) {
  std::vector<ParameterDescription> parameters;
  for (Config& config : root.Tables("parameter")) {
    ParameterDescription p;
    p.name = config.String("name");
    p.unit = config.String("unit");
    p.coordinate = config.Choice("coordinate", {"linear", "log"}) == 0 ? ParameterDescription::Coordinate::kLinear
                                                                       : ParameterDescription::Coordinate::kLog;
    const bool log = p.coordinate == ParameterDescription::Coordinate::kLog;
    p.mean = config.Number("mean", log ? kPositive : kFinite);
    p.variance = config.Number("variance", kPositive);
    for (const ParameterDescription& other : parameters) {
      if (other.name == p.name) config.Fail("name", fmt::format("= \"{}\" occurs twice", p.name));
    }
    config.Finish();
    parameters.push_back(std::move(p));
  }
  if (parameters.empty()) root.Fail("parameter", "is missing: at least one [[parameter]]");
  return parameters;
}

TaskSettings ReadTask(Config config) {
  TaskSettings s;
  s.name = config.String("name");
  s.period = config.Number("period", {1e-3, 10});
  s.steps = config.Integer("steps", {1, 1e6});
  config.Finish();
  return s;
}

ControllerSettings ReadController(Config config) {
  ControllerSettings s;
  s.state_timeout = config.Number("state_timeout", {1e-3, 10});
  s.place_tolerance = config.Number("place_tolerance", kPositive);
  config.Finish();
  return s;
}

CalibrationSettings ReadCalibration(Config config) {
  CalibrationSettings s;
  s.samples = config.Integer("samples", {4, 1e6});
  s.updates = config.Integer("updates", {1, 1000});
  s.kl = config.Number("kl", kPositive);
  s.min_temperature = config.Number("min_temperature", kPositive);
  s.horizons = config.Integers("horizons", {1, 10000});
  if (s.horizons.empty()) config.Fail("horizons", "is empty");
  config.Finish();
  return s;
}

TrainingSettings ReadTraining(Config config) {
  TrainingSettings s;
  s.batch = config.Integer("batch", {10, 1e7});
  s.updates = config.Integer("updates", kAtLeastOne);
  s.updates_again = config.Integer("updates_again", {0, 1e9});
  s.hidden = config.Integers("hidden", {1, 4096});
  s.gamma = config.Number("gamma", {0, 1});
  s.lambda = config.Number("lambda", {0, 1});
  s.kl = config.Number("kl", kPositive);
  s.damping = config.Number("damping", kNotNegative);
  s.cg_iterations = config.Integer("cg_iterations", {1, 1000});
  s.fisher_fraction = config.Number("fisher_fraction", {1e-3, 1});
  s.critic_l2 = config.Number("critic_l2", kNotNegative);
  s.critic_rate = config.Number("critic_rate", kPositive);
  s.critic_epochs = config.Integer("critic_epochs", {1, 10000});
  s.critic_minibatch = config.Integer("critic_minibatch", {1, 1e7});
  config.Finish();
  return s;
}

VirtualRobotSettings ReadVirtualRobot(Config config, const std::vector<ParameterDescription>& parameters) {
  VirtualRobotSettings s;
  s.watchdog = config.Number("watchdog", {0, 10});
  s.heartbeat = config.Number("heartbeat", {1e-3, 10});
  s.encoder_bits = config.Integer("encoder_bits", {4, 32});
  Config hidden = config.Table("hidden", false);
  for (const std::string& name : hidden.Keys()) {
    const std::vector<double> bounds = hidden.Numbers(name, 2);
    if (!(bounds[0] <= bounds[1])) hidden.Fail(name, "must be [lower, upper]");
    if (std::none_of(parameters.begin(), parameters.end(), [&](const auto& p) { return p.name == name; })) {
      hidden.Fail(name, "is not one of the parameters");
    }
    s.hidden.push_back({name, bounds[0], bounds[1]});
  }
  config.Finish();
  return s;
}

// FNV-1a, 64 bit (Fowler, Noll, Vo; RFC draft "The FNV Non-Cryptographic Hash Algorithm").
constexpr uint64_t kFnvOffset = 0xcbf29ce484222325, kFnvPrime = 0x100000001b3;

uint64_t Fingerprint(const std::string& file, uint64_t hash) {
  std::ifstream stream(file, std::ios::binary);
  for (std::istreambuf_iterator<char> c(stream), end; c != end; ++c) {
    hash = (hash ^ static_cast<unsigned char>(*c)) * kFnvPrime;
  }
  return hash;
}

void ReadMotors(Config& root, std::vector<JointDescription>& joints) {
  std::vector<bool> seen(joints.size());
  for (Config& config : root.Tables("joint")) {
    const std::string name = config.String("name");
    const auto joint = std::find_if(joints.begin(), joints.end(), [&](const auto& j) { return j.name == name; });
    if (joint == joints.end()) config.Fail("name", fmt::format("= \"{}\" is not a moving joint of the URDF", name));
    const auto index = static_cast<size_t>(joint - joints.begin());
    if (seen[index]) config.Fail("name", fmt::format("= \"{}\" occurs twice", name));
    seen[index] = true;
    MotorDescription& motor = joint->motor;
    motor.protocol = config.String("protocol");
    motor.node = config.Integer("node", {0, 0x3fffffff});
    motor.gear = config.Number("gear", kPositive, 1);
    motor.sign = config.Integer("sign", {-1, 1}, 1);
    if (motor.sign == 0) config.Fail("sign", "must be 1 or -1");
    motor.offset = config.Number("offset", kFinite, 0);
    for (size_t other = 0; other < joints.size(); ++other) {
      if (other != index && seen[other] && joints[other].motor.protocol == motor.protocol &&
          joints[other].motor.node == motor.node) {
        config.Fail("node", fmt::format("= {} is also joint {}'s", motor.node, joints[other].name));
      }
    }
    config.Finish();
  }
  for (size_t i = 0; i < joints.size(); ++i) {
    if (!seen[i]) root.Fail("joint", fmt::format("does not say how joint \"{}\" of the URDF is driven", joints[i].name));
  }
}

}  // namespace

double ParameterDescription::coordinate_variance() const {
  return coordinate == Coordinate::kLog ? std::log1p(variance / (mean * mean)) : variance;
}

double ParameterDescription::coordinate_mean() const {
  return coordinate == Coordinate::kLog ? std::log(mean) - coordinate_variance() / 2 : mean;
}

double ParameterDescription::ToPhysical(double value) const {
  return coordinate == Coordinate::kLog ? std::exp(value) : value;
}

double ParameterDescription::ToCoordinate(double value) const {
  return coordinate == Coordinate::kLog ? std::log(value) : value;
}

int RobotDescription::num_positions() const {
  int count = 0;
  for (const JointDescription& joint : joints) count += joint.num_positions();
  return count;
}

int RobotDescription::num_velocities() const {
  int count = 0;
  for (const JointDescription& joint : joints) count += joint.num_velocities();
  return count;
}

std::vector<int> RobotDescription::driven() const {
  std::vector<int> driven;
  for (int i = 0; i < num_joints(); ++i) {
    if (!joints[static_cast<size_t>(i)].passive) driven.push_back(i);
  }
  return driven;
}

Eigen::VectorXd RobotDescription::effort_limits() const {
  const std::vector<int> all = driven();
  Eigen::VectorXd limits(all.size());
  for (size_t i = 0; i < all.size(); ++i) {
    limits(static_cast<Eigen::Index>(i)) = joints[static_cast<size_t>(all[i])].effort_limit;
  }
  return limits;
}

Eigen::VectorXd RobotDescription::ToPhysical(const Eigen::VectorXd& coordinates) const {
  Eigen::VectorXd physical(coordinates.size());
  for (Eigen::Index i = 0; i < coordinates.size(); ++i) {
    physical(i) = parameters[static_cast<size_t>(i)].ToPhysical(coordinates(i));
  }
  return physical;
}

int RobotDescription::FindParameter(const std::string& parameter) const {
  for (size_t i = 0; i < parameters.size(); ++i) {
    if (parameters[i].name == parameter) return static_cast<int>(i);
  }
  return -1;
}

RobotDescription LoadRobot(const std::string& folder_or_file) {
  namespace fs = std::filesystem;
  fs::path file(folder_or_file);
  std::error_code error;
  if (fs::is_directory(file, error)) file /= "robot.toml";
  if (!fs::exists(file, error)) throw ConfigError(file.string() + ": there is no such robot");
  Config root = Config::Load(file.string());

  RobotDescription robot;
  robot.file = file.string();
  Config header = root.Table("robot");
  robot.name = header.String("name");
  const std::string urdf_file = header.String("urdf");
  header.Finish();
  const std::string urdf_path = (file.parent_path() / urdf_file).string();
  UrdfModel urdf = LoadUrdf(urdf_path);
  robot.fingerprint = Fingerprint(urdf_path, Fingerprint(robot.file, kFnvOffset));
  robot.links = std::move(urdf.links);
  robot.joints = std::move(urdf.joints);
  if (robot.joints.empty()) root.Fail("robot", "has no moving joint in " + urdf_file);
  ReadMotors(root, robot.joints);

  Config bus = root.Table("bus");
  robot.bus_url = bus.String("url");
  bus.Finish();
  robot.driver = ReadDriver(root.Table("driver"));
  robot.estimator = ReadEstimator(root.Table("estimator"));
  robot.task = ReadTask(root.Table("task"));
  robot.simulation = ReadSimulation(root.Table("simulation"), robot.task.period);
  robot.parameters = ReadParameters(root);
  robot.controller = ReadController(root.Table("controller"));
  robot.calibration = ReadCalibration(root.Table("calibration"));
  robot.training = ReadTraining(root.Table("training"));
  robot.virtual_robot = ReadVirtualRobot(root.Table("virtual_robot"), robot.parameters);
  root.Finish();
  return robot;
}

}  // namespace plumb
