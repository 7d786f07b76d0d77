#include "robot/joints.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/nearest_name.h"

namespace plumb {
namespace {

constexpr Range kAnyNumber{-1e9, 1e9}, kNotNegative{0, 1e9};

/// [joint.PROTOCOL] of the motor protocols that have keys of their own.
struct MotorTable {
  const char* protocol;
  void (*read)(Config& joint, MotorDescription& motor);
  /// against the joint's limits
  void (*check)(const Config& config, const JointDescription& joint);
  bool fd = false;  ///< it is spoken in frames of CAN FD
};
constexpr MotorTable kMotorTables[] = {
    {"mit", &ReadMit, &CheckMit},
    {"moteus", &ReadMoteus, &CheckMoteus, true},
    {"rmd", &ReadRmd, &CheckRmd},
};

MotorDescription ReadMotor(Config& config, const std::vector<BusDescription>& buses) {
  MotorDescription motor;
  motor.protocol = config.String("protocol");
  motor.bus = ReadBusOf(config, buses);
  motor.node = config.Integer("node", {0, 0x3fffffff});
  motor.gear = config.Number("gear", {1e-9, 1e9}, 1);
  motor.sign = config.Integer("sign", {-1, 1}, 1);
  if (motor.sign == 0) config.Fail("sign", "must be 1 or -1");
  motor.offset = config.Number("offset", kAnyNumber, 0);
  for (const MotorTable& table : kMotorTables) {
    if (motor.protocol == table.protocol) {
      table.read(config, motor);
    } else if (config.Has(table.protocol)) {
      config.Fail(table.protocol, fmt::format("is of protocol \"{}\", but the motor's is \"{}\"",
                                              table.protocol, motor.protocol));
    }
  }
  return motor;
}

// The URDF's, which `joint` has, with what the table says of them.
JointDynamics ReadDynamics(Config config, const JointDescription& joint) {
  JointDynamics dynamics = joint.dynamics;
  for (const JointParameterKind& kind : kJointParameterKinds) {
    if (config.Has(kind.key) && !joint.IsOf(kind.joints)) {
      config.Fail(kind.key, kind.joints == JointGroup::kDriven
                                ? "needs a motor: the joint is passive"
                                : "has no meaning for a spherical joint");
    }
    dynamics.*kind.member = config.Number(kind.key, kind.in_file, dynamics.*kind.member);
  }
  config.Finish();
  return dynamics;
}

JointLimitSettings ReadLimits(Config config, const JointDescription& joint) {
  JointLimitSettings limits;
  limits.position_margin = config.Number("position_margin", kNotNegative, 0);
  // One margin for each limit, and none of the other's.
  if (limits.position_margin > 0 && !(2 * limits.position_margin <= joint.upper - joint.lower)) {
    config.Fail("position_margin",
                fmt::format("= {} is more than half of what lies between the joint's limits",
                            limits.position_margin));
  }
  if (limits.position_margin > 0 && !std::isfinite(joint.upper - joint.lower)) {
    config.Fail("position_margin", "is of position limits, and the joint has none");
  }
  limits.effort_rate = config.Number("effort_rate", {1e-9, HUGE_VAL}, limits.effort_rate);
  limits.damping = config.Number("damping", kNotNegative, 0);
  config.Finish();
  return limits;
}

NoiseDescription ReadNoise(Config config) {
  NoiseDescription noise;
  const auto read = [&](const char* key, Range range, double& value) {
    if (config.Has(key)) value = config.Number(key, range);
  };
  read("position_sd", {1e-12, 1e12}, noise.position_sd);
  read("velocity_sd", {1e-12, 1e12}, noise.velocity_sd);
  read("jerk", {1e-12, 1e12}, noise.jerk);
  read("effort_step", {0, 1e12}, noise.effort_step);
  read("ground_impact", {0, 1e12}, noise.ground_impact);
  read("stop_impact", {0, 1e12}, noise.stop_impact);
  read("coupling", {0, 1}, noise.coupling);
  read("delay", {0, 0.1}, noise.delay);
  config.Finish();
  return noise;
}

void CheckMotor(const UrdfModel& urdf, size_t index) {
  const UrdfJoint& joint = urdf.joints[index];
  const std::string label = "joint " + joint.name;
  if (!(joint.effort_limit > 0)) {
    urdf.Fail(joint.limit_line, label + ": limit effort must be positive: it has a motor");
  }
  if (!std::isfinite(joint.velocity_limit)) {
    urdf.Fail(joint.limit_line, label + ": limit velocity is missing: it has a motor");
  }
}

// An acceleration is an effort divided by something.
void CheckInertia(const UrdfModel& urdf, const std::vector<JointDescription>& joints) {
  std::vector<double> beyond;  // [kg] of a link and all that it carries
  for (const LinkDescription& link : urdf.links) beyond.push_back(link.mass);
  for (size_t i = joints.size(); i-- > 0;) {
    const JointDescription& joint = joints[i];
    const auto child = static_cast<size_t>(joint.child);
    if (!(beyond[child] > 0) && !(joint.dynamics.armature > 0)) {
      urdf.Fail(urdf.link_lines[child],
                fmt::format("link {} moves but has no mass, nor has anything it carries or the "
                            "armature of joint {}",
                            urdf.links[child].name, joint.name));
    }
    beyond[static_cast<size_t>(joint.parent)] += beyond[child];
  }
}

}  // namespace

bool JointDescription::IsOf(JointGroup group) const {
  switch (group) {
    case JointGroup::kDriven:
      return !passive && type != Type::kSpherical;
    case JointGroup::kOneCoordinate:
      return type != Type::kSpherical;
    default:
      return true;
  }
}

bool NeedsFd(const MotorDescription& motor) {
  return std::ranges::any_of(kMotorTables, [&](const MotorTable& table) {
    return table.fd && motor.protocol == table.protocol;
  });
}

bool IsFixedJoint(const std::vector<LinkDescription>& links, const std::string& name) {
  return std::ranges::any_of(links, [&](const LinkDescription& link) {
    return std::ranges::find(link.fixed, name, &FixedLink::joint) != link.fixed.end();
  });
}

std::vector<JointDescription> JointsOf(const UrdfModel& urdf) {
  std::vector<JointDescription> joints;
  for (const UrdfJoint& joint : urdf.joints) {
    JointDescription description;
    static_cast<JointGeometry&>(description) = joint;
    description.dynamics.damping = joint.damping;
    description.dynamics.friction = joint.friction;
    joints.push_back(description);
  }
  return joints;
}

std::vector<JointDescription> ReadJoints(Config& root, const UrdfModel& urdf,
                                         const std::vector<BusDescription>& buses) {
  std::vector<JointDescription> joints = JointsOf(urdf);
  std::vector<bool> seen(joints.size());
  for (Config& config : root.Tables("joint")) {
    const std::string name = config.String("name");
    const auto joint =
        std::find_if(joints.begin(), joints.end(), [&](const auto& j) { return j.name == name; });
    if (joint == joints.end()) {
      if (IsFixedJoint(urdf.links, name))
        config.Fail(
            "name",
            fmt::format("= \"{}\" is fixed: a joint that does not move has no table", name));
      std::vector<std::string> moving;
      moving.reserve(joints.size());
      for (const auto& j : joints) moving.push_back(j.name);
      config.Fail("name",
                  fmt::format("= \"{}\" is not a moving joint of the URDF; the nearest is '{}'",
                              name, NearestName(name, moving)));
    }
    const auto index = static_cast<size_t>(joint - joints.begin());
    if (seen[index]) config.Fail("name", fmt::format("= \"{}\" occurs twice", name));
    joint->passive = config.Boolean("passive", false);
    if (joint->passive) {
      const auto refuse = [&](const char* key) {
        if (config.Has(key)) config.Fail(key, "is of a motor, but the joint is passive");
      };
      for (const char* key : {"protocol", "bus", "node", "gear", "sign", "offset"}) refuse(key);
      for (const MotorTable& table : kMotorTables) refuse(table.protocol);
      refuse("limits");
    } else {
      if (joint->type == JointDescription::Type::kSpherical) {
        config.Fail(
            "name",
            fmt::format("= \"{}\" is a spherical joint, which no motor drives: passive = true",
                        name));
      }
      joint->motor = ReadMotor(config, buses);
      CheckMotor(urdf, index);
      joint->limits = ReadLimits(config.Table("limits", false), *joint);
      for (const MotorTable& table : kMotorTables) {
        if (joint->motor.protocol == table.protocol) table.check(config, *joint);
      }
      for (size_t other = 0; other < joints.size(); ++other) {
        const MotorDescription &own = joint->motor, &others = joints[other].motor;
        if (seen[other] && !joints[other].passive && others.bus == own.bus &&
            others.protocol == own.protocol && others.node == own.node) {
          config.Fail("node", fmt::format("= {} is also joint {}'s, on {}", own.node,
                                          joints[other].name, buses[own.bus].Label()));
        }
      }
    }
    seen[index] = true;
    joint->dynamics = ReadDynamics(config.Table("dynamics", false), *joint);
    joint->noise = ReadNoise(config.Table("estimator", false));
    config.Finish();
  }
  for (size_t i = 0; i < joints.size(); ++i) {
    if (!seen[i]) joints[i].passive = urdf.joints[i].part;
    if (!seen[i] && !joints[i].passive) {
      root.Fail(
          "joint",
          fmt::format("does not say how joint \"{}\" of the URDF is driven, or passive = true",
                      joints[i].name));
    }
    if (joints[i].passive) joints[i].effort_limit = 0;
  }
  if (std::all_of(joints.begin(), joints.end(), [](const auto& joint) { return joint.passive; })) {
    root.Fail("joint", "drives no joint: all are passive");
  }
  CheckInertia(urdf, joints);
  return joints;
}

}  // namespace plumb
