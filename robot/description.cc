#include "robot/description.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "common/config.h"
#include "common/hash.h"
#include "common/nearest_name.h"
#include "robot/contact_pairs.h"
#include "robot/urdf/urdf.h"

namespace plumb {

int RobotDescription::position_of(int joint) const {
  int position = 0;
  for (int i = 0; i < joint; ++i) position += joints[static_cast<size_t>(i)].num_positions();
  return position;
}

int RobotDescription::velocity_of(int joint) const {
  int velocity = 0;
  for (int i = 0; i < joint; ++i) velocity += joints[static_cast<size_t>(i)].num_velocities();
  return velocity;
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
  return plumb::ToPhysical(parameters, coordinates);
}

int RobotDescription::FindParameter(const std::string& parameter) const {
  for (size_t i = 0; i < parameters.size(); ++i) {
    if (parameters[i].name == parameter) return static_cast<int>(i);
  }
  return -1;
}

std::string RobotDescription::ParameterOf(const std::string& path) const {
  std::string covering;
  for (const ParameterDescription& parameter : parameters) {
    if (parameter.name == path) return path;
    if (Covers(parameter.name, path)) covering = parameter.name;
  }
  for (const FrozenParameter& parameter : frozen) {
    if (parameter.name == path) return path;
    if (Covers(parameter.name, path)) covering = parameter.name;
  }
  return covering;
}

namespace {

namespace fs = std::filesystem;

// The TOML file of a folder.
fs::path FileOf(const fs::path& folder_or_file) {
  std::error_code error;
  return fs::is_directory(folder_or_file, error) ? folder_or_file / "robot.toml" : folder_or_file;
}

// Where robots are installed with the programs; a build has none there.
fs::path Installed(const fs::path& robot) {
  std::error_code error;
  const fs::path programs = fs::read_symlink("/proc/self/exe", error).parent_path();
  return robot.is_relative() ? FileOf(programs.parent_path() / "share/plumbline" / robot) : robot;
}

UrdfModel ReadUrdf(Config& header, const std::string& file, const std::vector<std::string>& fixed) {
  try {
    return LoadUrdf(file, fixed);
  } catch (const std::invalid_argument& error) {
    header.Fail("fixed", std::string("= ") + error.what());
  }
}

// A bus with nothing on it is a mistake: its joints are on another.
void RequireUse(Config& root, const RobotDescription& robot) {
  for (size_t i = 0; i < robot.buses.size(); ++i) {
    const bool used =
        std::ranges::any_of(robot.joints,
                            [&](const auto& j) { return !j.passive && j.motor.bus == i; }) ||
        std::ranges::any_of(robot.sensors, [&](const auto& sensor) { return sensor.bus == i; });
    if (!used)
      FailAtBus(root, i, "name",
                fmt::format("= \"{}\" has no joint and no sensor on it", robot.buses[i].name));
  }
}

// "; did you mean robots/pendulum?", or from where a relative path was looked for.
std::string Neighbour(const fs::path& path) {
  std::error_code error;
  const fs::path name = path.has_filename() ? path : path.parent_path();
  std::vector<std::string> there;
  for (const fs::directory_entry& entry : fs::directory_iterator(name.parent_path(), error)) {
    const fs::path file = FileOf(entry.path());
    if (file.extension() == ".toml" && fs::exists(file, error))
      there.push_back(entry.path().string());
  }
  if (!there.empty()) return fmt::format("; did you mean {}?", NearestName(name.string(), there));
  return path.is_relative() ? ", seen from " + fs::current_path(error).string() : "";
}

void RequireFd(Config& root, const RobotDescription& robot) {
  for (const JointDescription& joint : robot.joints) {
    const MotorDescription& motor = joint.motor;
    if (!joint.passive && NeedsFd(motor) && robot.buses[motor.bus].data_bit_rate == 0) {
      FailAtBus(root, motor.bus, "data_bit_rate",
                fmt::format("is missing: joint \"{}\" speaks {}, which needs a bus of CAN FD",
                            joint.name, motor.protocol));
    }
  }
}

// Here, else among those that are installed.
fs::path FindRobot(const std::string& folder_or_file, bool* here) {
  fs::path file = FileOf(folder_or_file);
  std::error_code error;
  *here = fs::exists(file, error);
  if (!*here) {
    const fs::path installed = Installed(folder_or_file);
    if (!fs::exists(installed, error))
      throw ConfigError(file.string() + ": there is no such robot" + Neighbour(folder_or_file));
    file = installed;
  }
  if (file.extension() == ".urdf")
    throw ConfigError(file.string() + ": is a URDF: give the folder or the TOML file of its robot");
  return file;
}

// The URDF that [robot] names. @param files is added to.
UrdfModel ReadModel(Config header, std::vector<std::string>* files) {
  const std::string path = FindUrdf(header);
  const std::vector<std::string> fixed = header.Strings("fixed", std::vector<std::string>{});
  header.Finish();
  files->push_back(path);
  return ReadUrdf(header, path, fixed);
}

std::vector<std::string> WarningsOf(const UrdfModel& urdf, const SimulationSettings& simulation) {
  std::vector<std::string> warnings = urdf.warnings;
  const auto add = [&](const std::vector<std::string>& more) {
    warnings.insert(warnings.end(), more.begin(), more.end());
  };
  if (simulation.contact) add(urdf.contact_warnings);
  if (simulation.contact && !simulation.link_pairs.empty()) add(urdf.pair_warnings);
  return warnings;
}

}  // namespace

RobotDescription LoadRobot(const std::string& folder_or_file) {
  bool here;
  const fs::path file = FindRobot(folder_or_file, &here);
  std::vector<std::string> files;
  Config root = Config::Load(file.string(), &files);

  RobotDescription robot;
  robot.file = file.string();
  Config header = root.Table("robot");
  robot.name = header.String("name");
  UrdfModel urdf = ReadModel(std::move(header), &files);
  if (urdf.joints.empty()) root.Fail("robot", "has no moving joint in " + files.back());
  robot.buses = ReadBuses(root);
  robot.joints = ReadJoints(root, urdf, robot.buses);
  RequireFd(root, robot);
  robot.links = urdf.links;
  robot.sensors = ReadSensors(root, robot);
  RequireUse(root, robot);
  robot.driver = ReadDriver(root.Table("driver"), robot.joints);
  robot.task = ReadTask(root.Table("task"), robot.joints, robot.links);
  robot.simulation = ReadSimulation(root.Table("simulation"), robot.task.period);
  if (robot.simulation.contact && robot.simulation.meshes) {
    robot.meshes = urdf.LoadCollisionMeshes();
    robot.links = std::move(urdf.links);
    files.insert(files.end(), robot.meshes.begin(), robot.meshes.end());
  }
  robot.fingerprint = kEmptyHash;
  for (const std::string& part : files) robot.fingerprint = Hash(ReadFile(part), robot.fingerprint);
  robot.estimator = ReadEstimator(root.Table("estimator"), robot);
  robot.warnings = WarningsOf(urdf, robot.simulation);
  // Whoever meant his own must see that it is another one.
  if (!here)
    robot.warnings.push_back(folder_or_file +
                             " is not here, the installed one is taken: " + file.string());
  FindContactPairs(robot);  // or it says what is wrong with one
  ReadParameters(root, robot.parameters, robot.frozen);
  robot.controller = ReadController(root.Table("controller"));
  robot.calibration = ReadCalibration(root.Table("calibration"));
  robot.training = ReadTraining(root.Table("training"));
  robot.virtual_robot = ReadVirtualRobot(root.Table("virtual_robot"), robot);
  root.Finish();
  return robot;
}

}  // namespace plumb
