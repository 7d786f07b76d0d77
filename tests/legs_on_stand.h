#pragma once

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace plumb {

/// The legs of robots/quadruped, its trunk on a stand: twelve drives at 500 Hz, three on each of
/// four buses named as the legs are, with the same ids on each.
struct LegsOnStand {
  static constexpr std::array<const char*, 4> kLegs = {"front_left", "front_right", "rear_left",
                                                       "rear_right"};
  static constexpr std::array<const char*, 3> kJoints = {"hip", "thigh", "knee"};

  /// Writes robot.urdf and robot.toml into a folder. @param robots the folder of that name.
  /// @param urls of the buses.
  static void Write(const std::filesystem::path& robots, const std::filesystem::path& folder,
                    const std::array<std::string, 4>& urls) {
    std::filesystem::create_directories(folder);
    std::stringstream text;
    text << std::ifstream(robots / "quadruped/robot.urdf").rdbuf();
    std::string urdf = text.str();
    const std::string floating = "type=\"floating\"", origin = "<origin xyz=\"0 0 0\"";
    const size_t base = urdf.find(floating), at = urdf.find(origin, base);
    urdf.replace(at, origin.size(), "<origin xyz=\"0 0 1\"");
    urdf.replace(base, floating.size(), "type=\"fixed\"");
    std::ofstream(folder / "robot.urdf") << urdf;

    std::string toml = "[robot]\nname = \"legs\"\nurdf = \"robot.urdf\"\n", targets;
    for (size_t leg = 0; leg < kLegs.size(); ++leg) {
      toml += fmt::format("[[bus]]\nname = \"{}\"\nurl = \"{}\"\n", kLegs[leg], urls[leg]);
      for (size_t joint = 0; joint < kJoints.size(); ++joint) {
        const std::string name = fmt::format("{}_{}", kLegs[leg], kJoints[joint]);
        toml += fmt::format(
            "[[joint]]\nname = \"{}\"\nprotocol = \"cansimple\"\nbus = \"{}\"\nnode = {}\n"
            "[joint.dynamics]\narmature = 0.01\ndamping = 0.6\n",
            name, kLegs[leg], joint + 1);
        targets += fmt::format("{}{} = {}", targets.empty() ? "" : ", ", name,
                               joint == 0   ? 0.0
                               : joint == 1 ? 0.8
                                            : -1.5);
      }
    }
    std::ofstream(folder / "robot.toml") << toml << kSettings << "target = {" << targets << "}\n";
  }

 private:
  static constexpr char kSettings[] = R"([driver]
cycle = 0.002
measurement = 0.002
expiry = 0.05
disarm_after = 0.1
stale_after = 0.02
heartbeat_timeout = 0.5
start_guard = 0.25
[estimator]
position_sd = 1.2e-4
velocity_sd = 0.5
jerk = 300.0
effort_step = 1.0
timing_sd = 2e-5
lag = 20
reset_after = 0.2
[simulation]
integrator = "semi-implicit"
substep = 0.002
latency = 0.002
[simulation.limit]
stiffness = 500.0
damping = 5.0
[[parameter]]
name = "armature/front_left_hip"
unit = "kg m^2"
coordinate = "log"
mean = 0.01
variance = 1e-5
[controller]
state_timeout = 0.03
place_tolerance = 0.1
[calibration]
samples = 40
updates = 5
kl = 0.1
min_temperature = 1.0
horizons = [1, 5]
[training]
batch = 4000
updates = 10
updates_again = 5
hidden = [16]
gamma = 0.99
lambda = 0.95
kl = 0.02
damping = 0.1
cg_iterations = 10
fisher_fraction = 0.1
critic_l2 = 1e-4
critic_rate = 1e-3
critic_epochs = 5
critic_minibatch = 512
[virtual_robot]
watchdog = 0.1
heartbeat = 0.02
encoder_bits = 14
[virtual_robot.hidden]
"armature/front_left_hip" = [0.008, 0.012]
[task]
name = "hold"
period = 0.01
steps = 1000000
spread = 0.1
)";
};

}  // namespace plumb
