#include "tests/sim/trees.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <limits>

#include "robot/urdf/urdf.h"
#include "tests/robot/zoo.h"
#include "tests/sim/robots.h"

namespace plumb {

RobotDescription LoadExample(const std::string& name) {
  const char* source = std::getenv("PLUMBLINE_SOURCE");
  return LoadRobot(std::string(source ? source : ".") + "/robots/" + name);
}

Eigen::Vector3d DrawVector(Random& random, double size) {
  Eigen::Vector3d vector;
  for (double& entry : vector) entry = random.Uniform(-size, size);
  return vector;
}

Eigen::Vector3d DrawDirection(Random& random) {
  Eigen::Vector3d vector;
  for (double& entry : vector) entry = random.Normal();
  return vector.normalized();
}

Eigen::VectorXd DrawPosition(const RobotDescription& robot, Random& random, double angle) {
  Eigen::VectorXd q(robot.num_positions());
  Eigen::Index at = 0;
  for (const JointDescription& joint : robot.joints) {
    if (joint.type == JointDescription::Type::kSpherical) {
      for (int k = 0; k < 4; ++k) q[at + k] = random.Normal();
      q.segment<4>(at).normalize();
    } else {
      const double size = joint.type == JointDescription::Type::kPrismatic ? 1 : angle;
      q[at] = random.Uniform(-size, size);
    }
    at += joint.num_positions();
  }
  return q;
}

Eigen::VectorXd DrawNumbers(Eigen::Index count, Random& random, double size) {
  Eigen::VectorXd numbers(count);
  for (double& number : numbers) number = random.Uniform(-size, size);
  return numbers;
}

std::vector<Eigen::Isometry3d> LinkPoses(const RobotDescription& robot, const Eigen::VectorXd& q) {
  std::vector<Eigen::Isometry3d> poses{Eigen::Isometry3d::Identity()};
  Eigen::Index at = 0;
  for (const JointDescription& joint : robot.joints) {
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    switch (joint.type) {
      case JointDescription::Type::kSpherical:
        motion.linear() =
            Eigen::Quaterniond(q[at], q[at + 1], q[at + 2], q[at + 3]).normalized().matrix();
        break;
      case JointDescription::Type::kPrismatic:
        motion.translation() = q[at] * joint.axis;
        break;
      default:
        motion.linear() = Eigen::AngleAxisd(q[at], joint.axis).matrix();
    }
    Eigen::Isometry3d fixed = Eigen::Isometry3d::Identity();
    fixed.linear() = joint.rotation;
    fixed.translation() = joint.origin;
    poses.push_back(poses[static_cast<size_t>(joint.parent)] * fixed * motion);
    at += joint.num_positions();
  }
  return poses;
}

double PotentialEnergy(const RobotDescription& robot, const Eigen::VectorXd& q) {
  const std::vector<Eigen::Isometry3d> poses = LinkPoses(robot, q);
  double energy = 0;
  Eigen::Index at = 0;
  for (size_t i = 1; i < robot.links.size(); ++i) {
    const LinkDescription& link = robot.links[i];
    energy += link.mass * robot.simulation.gravity * (poses[i] * link.center_of_mass).z();
    const JointDescription& joint = robot.joints[i - 1];
    const double stretch = q[at] - joint.dynamics.rest;
    if (joint.type != JointDescription::Type::kSpherical)
      energy += joint.dynamics.stiffness / 2 * stretch * stretch;
    at += joint.num_positions();
  }
  return energy;
}

RobotDescription Frictionless(RobotDescription robot) {
  for (JointDescription& joint : robot.joints) {
    joint.dynamics.damping = joint.dynamics.friction = 0;
    joint.dynamics.delay = joint.dynamics.sensor_delay = joint.dynamics.sensor_bias = 0;
    joint.dynamics.no_load_speed = std::numeric_limits<double>::infinity();
  }
  robot.simulation.contact.reset();
  robot.simulation.stop.reset();
  robot.simulation.speed_clip = std::numeric_limits<double>::infinity();
  robot.parameters.clear();
  robot.frozen.clear();
  robot.virtual_robot.hidden.clear();
  return robot;
}

RobotDescription FromUrdf(const std::string& urdf) {
  const RobotFolder folder(urdf, "");
  UrdfModel model = LoadUrdf(folder.urdf());
  RobotDescription robot = Frictionless(LoadPendulum("robot.toml"));
  robot.links = std::move(model.links);
  robot.joints = JointsOf(model);
  return Frictionless(robot);
}

std::string TreeWriter::Text(const Eigen::Vector3d& v) {
  char text[100];
  std::snprintf(text, sizeof text, "%.17g %.17g %.17g", v.x(), v.y(), v.z());
  return text;
}

std::string TreeWriter::Origin(const Eigen::Vector3d& xyz, const Eigen::Vector3d& rpy) {
  return "<origin xyz='" + Text(xyz) + "' rpy='" + Text(rpy) + "'/>";
}

std::string TreeWriter::Inertial() {
  // Moments that a body can have, in axes of their own, seen in yet others.
  const Eigen::Vector3d squares(random_.Uniform(.01, .1), random_.Uniform(.01, .1),
                                random_.Uniform(.01, .1));
  const double mass = random_.Uniform(0.2, 3);
  const Eigen::Vector3d moments = mass * (squares.sum() * Eigen::Vector3d::Ones() - squares);
  const Eigen::Matrix3d axes =
      Eigen::AngleAxisd(random_.Uniform(0, 3), DrawDirection(random_)).matrix();
  const Eigen::Matrix3d i = axes * moments.asDiagonal() * axes.transpose();
  char text[300];
  std::snprintf(
      text, sizeof text,
      "<mass value='%.17g'/><inertia ixx='%.17g' ixy='%.17g' ixz='%.17g' iyy='%.17g' iyz='%.17g' "
      "izz='%.17g'/>",
      mass, i(0, 0), i(0, 1), i(0, 2), i(1, 1), i(1, 2), i(2, 2));
  return "<inertial>" + Origin(DrawVector(random_, .3), DrawVector(random_, 3)) + text +
         "</inertial>";
}

std::string TreeWriter::Write(int most, const Eigen::Vector3d& normal) {
  const bool planar = !normal.isZero();
  const int joints = 1 + static_cast<int>(random_.Uniform() * most);
  std::vector<Eigen::Matrix3d> axes{Eigen::Matrix3d::Identity()};  // of the links at q = 0
  std::vector<bool> carries(static_cast<size_t>(joints) + 1);      // a link that is fixed to it
  std::string text;
  for (int i = 1; i <= joints; ++i) {
    const char* types[] = {"revolute", "continuous", "prismatic", "fixed", "planar", "floating"};
    const std::string type = i == 1 ? types[planar ? 1 : 0]
                                    : types[static_cast<int>(random_.Uniform(0, planar ? 5 : 6))];
    const int parent = static_cast<int>(random_.Uniform(std::max(0, i - 4), i));
    const Eigen::Vector3d rpy = DrawVector(random_, 3);
    axes.push_back(axes[static_cast<size_t>(parent)] *
                   (Eigen::AngleAxisd(rpy.z(), Eigen::Vector3d::UnitZ()) *
                    Eigen::AngleAxisd(rpy.y(), Eigen::Vector3d::UnitY()) *
                    Eigen::AngleAxisd(rpy.x(), Eigen::Vector3d::UnitX()))
                       .matrix());
    Eigen::Vector3d axis = DrawDirection(random_);
    if (planar) {
      axis = type == "prismatic" ? Eigen::Vector3d(axis.cross(normal).normalized())
                                 : Eigen::Vector3d((i % 2 ? 1 : -1) * normal);
      axis = axes.back().transpose() * axis;
    }
    text += "<joint name='j" + std::to_string(i) + "' type='" + type + "'><parent link='l" +
            std::to_string(parent) + "'/><child link='l" + std::to_string(i) + "'/>" +
            Origin(DrawVector(random_, 1), rpy) + "<axis xyz='" + Text(axis) +
            "'/><limit lower='-9' upper='9' effort='5' velocity='9'/></joint>";
    if (type == "fixed") carries[static_cast<size_t>(parent)] = true;
  }
  for (int i = 0; i <= joints; ++i) {
    const bool massless = carries[static_cast<size_t>(i)] && i % 2 == 0;
    text += "<link name='l" + std::to_string(i) + "'>" + (massless ? "" : Inertial()) + "</link>";
  }
  return "<robot name='tree'>" + text + "</robot>";
}

}  // namespace plumb
