#include "robot/sensors.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "robot/description.h"
#include "robot/roll_pitch_yaw.h"
#include "robot/settings/ranges.h"

namespace plumb {
namespace {

constexpr double kMaxCounts = 4294967296;  // an unsigned 32-bit position
// Of an IMU about which nothing is said, of the size that data sheets of industrial ones give: half
// a degree of tilt while it moves, and what its vibration adds to the rate's and the force's own
// noise.
constexpr double kAngleSd = 0.01, kRateSd = 0.01, kRateBiasSd = 0.01;  // [rad], [rad/s], [rad/s]
constexpr double kAccelerationSd = 0.3, kAccelerationBiasSd = 0.1;     // [m/s^2]

/// Index of what has the name, or an error at the key that gave it.
template <class T>
int Find(const Config& config, const char* key, const std::string& name, const std::vector<T>& all,
         const char* what) {
  const auto at =
      std::find_if(all.begin(), all.end(), [&](const T& one) { return one.name == name; });
  if (at == all.end())
    config.Fail(key, fmt::format("= \"{}\" is not a {} of the URDF", name, what));
  return static_cast<int>(at - all.begin());
}

void ReadEncoder(Config& config, const RobotDescription& robot, SensorDescription& s) {
  using Type = JointDescription::Type;
  s.node = config.Integer("node", {1, 127});
  s.counts = config.Number("counts", {2, kMaxCounts});
  s.range = config.Number("range", {2, kMaxCounts}, s.counts);
  for (const auto& [key, counts] : {std::pair{"counts", s.counts}, std::pair{"range", s.range}}) {
    if (counts != std::floor(counts))
      config.Fail(key, fmt::format("= {} is not a whole number", counts));
  }
  s.sign = config.Integer("sign", {-1, 1}, 1);
  if (s.sign == 0) config.Fail("sign", "must be 1 or -1");
  s.offset = config.Number("offset", {-1e9, 1e9}, 0);
  if (s.period * 1e3 < 1 - 1e-6 || std::abs(s.period * 1e3 - std::round(s.period * 1e3)) > 1e-6)
    config.Fail("period",
                "must be a whole number of milliseconds: an encoder's timer has no other");
  s.max_speed = config.Number("max_speed", {1e-3, 1e6});
  // Between two readings it must turn by less than half of what it can tell apart.
  const double half = s.range / s.counts * std::acos(-1.);
  if (s.max_speed * s.period >= half) {
    config.Fail(
        "max_speed",
        fmt::format("= {} rad/s turns it by {:.3g} rad within a period, half its range or more",
                    s.max_speed, s.max_speed * s.period));
  }
  // A reading is anywhere within its count: uniform, whose sd is width / sqrt(12).
  const double turn = 2 * std::acos(-1.);
  const std::string joint = config.String("joint");
  s.joint = Find(config, "joint", joint, robot.joints, "moving joint");
  const Type type = robot.joints[static_cast<size_t>(s.joint)].type;
  if (type == Type::kSpherical) {
    config.Fail(
        "joint",
        fmt::format("= \"{}\" is a spherical joint: an encoder measures one coordinate", joint));
  }
  if (config.Has("tolerance")) {
    if (robot.joints[static_cast<size_t>(s.joint)].passive) {
      config.Fail("tolerance",
                  fmt::format("is of two encoders of one joint, but \"{}\" has no motor", joint));
    }
    s.tolerance = config.Number("tolerance", {1e-6, 1e6});
  }
  if (type == Type::kPrismatic) {
    s.radius = config.Number("radius", {1e-6, 1e6});
  } else if (config.Has("radius")) {
    config.Fail("radius", fmt::format("is of a joint that slides, but \"{}\" turns", joint));
  }
  s.noise.position_sd =
      config.Number("position_sd", kSanePositive, s.radius * turn / s.counts / std::sqrt(12.));
  if (config.Has("velocity_sd")) s.noise.velocity_sd = config.Number("velocity_sd", kSanePositive);
}

void ReadImu(Config& config, const RobotDescription& robot, SensorDescription& s) {
  s.base = config.Integer("base", {0, 0x7FF - 0x7F}, 0);
  s.tick = config.Number("tick", {1e-9, 1}, s.tick);
  s.link = Find(config, "link", config.String("link"), robot.links, "link");
  const std::vector<double> rpy = config.Numbers("rpy", 3, {-10, 10}, std::vector<double>(3));
  s.rotation = FromRollPitchYaw(Eigen::Vector3d(rpy.data())).toRotationMatrix();
  s.noise.position_sd = config.Number("angle_sd", kSanePositive, kAngleSd);
  s.noise.velocity_sd = config.Number("rate_sd", kSanePositive, kRateSd);
  s.rate_bias_sd = config.Number("rate_bias_sd", {0, 1e3}, kRateBiasSd);
  s.acceleration_sd = config.Number("acceleration_sd", kSanePositive, kAccelerationSd);
  s.acceleration_bias_sd = config.Number("acceleration_bias_sd", {0, 1e3}, kAccelerationBiasSd);
}

/// The keys of a sensor, by its protocol.
struct SensorKind {
  const char* protocol;
  void (*read)(Config& config, const RobotDescription& robot, SensorDescription& sensor);
};
constexpr SensorKind kSensorKinds[] = {
    {"cia406", &ReadEncoder},
    {"xsens", &ReadImu},
};

}  // namespace

std::vector<SensorDescription> ReadSensors(Config& root, const RobotDescription& robot) {
  std::vector<SensorDescription> sensors;
  for (Config& config : root.Tables("sensor")) {
    SensorDescription s;
    s.name = config.String("name");
    if (s.name.empty()) config.Fail("name", "is empty");
    for (const SensorDescription& other : sensors) {
      if (other.name == s.name) config.Fail("name", fmt::format("= \"{}\" occurs twice", s.name));
    }
    for (const JointDescription& joint : robot.joints) {
      if (joint.name == s.name) config.Fail("name", fmt::format("= \"{}\" is a joint's", s.name));
    }
    std::vector<std::string> protocols;
    for (const SensorKind& kind : kSensorKinds) protocols.emplace_back(kind.protocol);
    const SensorKind& kind = kSensorKinds[config.Choice("protocol", protocols)];
    s.protocol = kind.protocol;
    s.bus = ReadBusOf(config, robot.buses);
    s.period = config.Number("period", {1e-4, 1});
    kind.read(config, robot, s);
    if (config.Has("delay")) s.noise.delay = config.Number("delay", {0, 0.1});
    config.Finish();
    sensors.push_back(s);
  }
  return sensors;
}

}  // namespace plumb
