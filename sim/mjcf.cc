#include "sim/mjcf.h"

#include <fmt/format.h>
#include <tinyxml.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "common/decompositions.h"
#include "robot/contact_pairs.h"
#include "robot/contact_points.h"

namespace plumb {
namespace {

using Type = JointDescription::Type;

constexpr double kPoint = 1e-6;  // [m] radius of a box's corner: MuJoCo knows no points

std::string Words(const Eigen::Vector3d& v) { return fmt::format("{} {} {}", v[0], v[1], v[2]); }

std::string Turn(const Eigen::Matrix3d& rotation) {
  const Eigen::Quaterniond q(rotation);
  return fmt::format("{} {} {} {}", q.w(), q.x(), q.y(), q.z());
}

std::string Name(const std::string& name) {
  std::string escaped;
  TiXmlBase::EncodeString(name, &escaped);
  return escaped;
}

/// MuJoCo knows no rods that are infinitely thin.
Eigen::Matrix3d Solid(const Eigen::Matrix3d& inertia) {
  const double least = 1e-9 * inertia.trace();
  const bool thin = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Eigen::MatrixXd(inertia),
                                                                   Eigen::EigenvaluesOnly)
                        .eigenvalues()[0] < least;
  return inertia + (thin ? least : 0) * Eigen::Matrix3d::Identity();
}

/// Where a joint is in the frame of a body that it moves, perhaps through links without mass.
struct Placed {
  size_t joint;
  Eigen::Isometry3d frame;
};

class Writer {
 public:
  explicit Writer(const RobotDescription& robot)
      : robot_(robot), touching_(FindContactPairs(robot)) {}

  std::string Write() {
    text_ = fmt::format(
        "<mujoco model=\"{}\"><compiler angle=\"radian\"/>\n"
        "<option timestep=\"0.002\" integrator=\"RK4\" gravity=\"{}\"/>\n<worldbody>\n",
        Name(robot_.name), Words(robot_.simulation.gravity * robot_.virtual_robot.ground.Down()));
    if (const auto& contact = robot_.simulation.contact) {
      softness_ =
          fmt::format("condim=\"3\" margin=\"0.001\" solref=\"{} 1\" solimp=\"0.8 0.8 0.01\"",
                      ContactTime(robot_));
      surface_ = fmt::format("friction=\"{} 0.005 0.0001\" {}", contact->friction, softness_);
      text_ += "<geom type=\"plane\" size=\"0 0 1\" contype=\"0\" conaffinity=\"1\" " + surface_ +
               "/>\n";
    }
    RequireBodies();
    for (const ContactPairs::Solid& at : touching_.solids) {
      if (at.link == 0) WriteShape(0, at.shape);
    }
    WriteChildren(0);
    text_ += "</worldbody>\n<actuator>\n";
    for (const int i : robot_.driven()) WriteMotor(joint(static_cast<size_t>(i)));
    text_ += "</actuator>\n";
    if (!touching_.pairs.empty()) WritePairs();
    return text_ + "</mujoco>\n";
  }

 private:
  const JointDescription& joint(size_t index) const { return robot_.joints[index]; }

  /// What has a shape that touches something has to be a body.
  void RequireBodies() const {
    if (!robot_.simulation.contact) return;
    for (size_t i = 0; i < robot_.joints.size(); ++i) {
      const LinkDescription& link = robot_.links[i + 1];
      if (!Weightless(i) || link.collisions.empty()) continue;
      throw std::invalid_argument(fmt::format(
          "contact of link '{}', which has no mass, with the ground or other links", link.name));
    }
  }

  void WriteChildren(int link) {
    for (size_t i = 0; i < robot_.joints.size(); ++i) {
      if (joint(i).parent == link) WriteBody(i);
    }
  }

  /// @param first joint of the body.
  void WriteBody(size_t first) {
    // A link that weighs nothing is no body there: its joint is one more of the next link's.
    std::vector<Placed> placed;
    Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
    size_t last = first;
    for (;; ++last) {
      frame.translate(joint(last).origin).rotate(joint(last).rotation);
      placed.push_back({last, frame});
      if (!Weightless(last)) break;
    }
    const LinkDescription& link = robot_.links[last + 1];
    text_ += fmt::format("<body name=\"{}\" pos=\"{}\" quat=\"{}\">\n", Name(link.name),
                         Words(frame.translation()), Turn(frame.linear()));
    for (const Placed& p : placed) WriteJoint(p.joint, frame.inverse() * p.frame);
    const Eigen::Matrix3d inertia = Solid(link.inertia);
    text_ += fmt::format(
        "<inertial pos=\"{}\" mass=\"{}\" "
        "fullinertia=\"{} {} {} {} {} {}\"/>\n",
        Words(link.center_of_mass), link.mass, inertia(0, 0), inertia(1, 1), inertia(2, 2),
        inertia(0, 1), inertia(0, 2), inertia(1, 2));
    if (robot_.simulation.contact) {
      for (size_t i = 0; i < link.collisions.size(); ++i) WriteShape(last + 1, i);
    }
    WriteChildren(static_cast<int>(last) + 1);
    text_ += "</body>\n";
  }

  /// Whether the link of that joint has no mass and carries the next one alone.
  bool Weightless(size_t index) const {
    const int link = static_cast<int>(index) + 1;
    int carried = 0;
    for (const JointDescription& other : robot_.joints) carried += other.parent == link;
    return robot_.links[index + 1].mass == 0 && carried == 1;
  }

  void WriteJoint(size_t index, const Eigen::Isometry3d& in_body) {
    const JointDescription& j = joint(index);
    if (j.type == Type::kSpherical) {
      text_ += fmt::format("<joint name=\"{}\" type=\"ball\" pos=\"{}\"/>\n", Name(j.name),
                           Words(in_body.translation()));
      return;
    }
    const bool limited = robot_.simulation.stop && std::isfinite(j.upper);
    text_ += fmt::format(
        "<joint name=\"{}\" type=\"{}\" pos=\"{}\" axis=\"{}\" armature=\"{}\" "
        "damping=\"{}\" frictionloss=\"{}\" stiffness=\"{}\" springref=\"{}\"",
        Name(j.name), j.type == Type::kPrismatic ? "slide" : "hinge", Words(in_body.translation()),
        Words(in_body.linear() * j.axis), j.dynamics.armature, j.dynamics.damping,
        j.dynamics.friction, j.dynamics.stiffness, j.dynamics.rest);
    if (limited) text_ += fmt::format(" limited=\"true\" range=\"{} {}\"", j.lower, j.upper);
    text_ += "/>\n";
  }

  void WriteMotor(const JointDescription& j) {
    const JointDynamics& d = j.dynamics;
    if ((d.kp > 0 || d.kd > 0) && d.motor_gain > 0) {
      // Lengths and speeds of an actuator are the joint's times its gear, too.
      text_ += fmt::format(
          "<general name=\"{0}\" joint=\"{0}\" gear=\"{1}\" gainprm=\"1\" biastype=\"affine\" "
          "biasprm=\"{2} {3} {4}\" forcelimited=\"true\" forcerange=\"{5} {6}\"/>\n",
          Name(j.name), d.motor_gain, d.kp * d.rest, -d.kp / d.motor_gain, -d.kd / d.motor_gain,
          -j.effort_limit, j.effort_limit);
      return;
    }
    text_ += fmt::format(
        "<motor name=\"{0}\" joint=\"{0}\" gear=\"{1}\" ctrllimited=\"true\" "
        "ctrlrange=\"{2} {3}\"/>\n",
        Name(j.name), j.dynamics.motor_gain, -j.effort_limit, j.effort_limit);
  }

  /// Of a shape of a link: for the pairs.
  std::string ShapeName(size_t link, size_t shape) const {
    return fmt::format("{}/{}", Name(robot_.links[link].name), shape);
  }

  void WriteShape(size_t link, size_t index) {
    const Shape& shape = robot_.links[link].collisions[index];
    std::string type, size;
    switch (shape.type) {
      case Shape::Type::kSphere:
        type = "sphere", size = fmt::format("{}", std::max(shape.size[0], kPoint));
        break;
      case Shape::Type::kCapsule:
        type = "capsule", size = fmt::format("{} {}", shape.size[0], shape.size[1] / 2);
        break;
      case Shape::Type::kBox:
        type = "box", size = Words(shape.size / 2);
        break;
      case Shape::Type::kMesh:
        for (const auto& [corner, radius] : ContactSpheres(shape)) {
          text_ += fmt::format(
              "<geom type=\"sphere\" size=\"{}\" pos=\"{}\" contype=\"1\" "
              "conaffinity=\"0\" {}/>\n",
              kPoint, Words(corner), surface_);
        }
        return;
      default:
        return;  // the robot's warnings say so
    }
    text_ += fmt::format(
        "<geom name=\"{}\" type=\"{}\" size=\"{}\" pos=\"{}\" quat=\"{}\" contype=\"{}\" "
        "conaffinity=\"0\" {}/>\n",
        ShapeName(link, index), type, size, Words(shape.position), Turn(shape.rotation),
        link > 0 ? 1 : 0, surface_);
  }

  void WritePairs() {
    text_ += "<contact>\n";
    for (const auto& [first, second] : touching_.pairs) {
      const auto name = [this](size_t solid) {
        const ContactPairs::Solid& at = touching_.solids[solid];
        return ShapeName(static_cast<size_t>(at.link), at.shape);
      };
      text_ += fmt::format(
          "<pair geom1=\"{0}\" geom2=\"{1}\" friction=\"{3} {3} 0.005 0.0001 0.0001\" {2}/>\n",
          name(first), name(second), softness_, robot_.simulation.contact->friction);
    }
    text_ += "</contact>\n";
  }

  const RobotDescription& robot_;
  const ContactPairs touching_;
  std::string softness_, surface_, text_;
};

}  // namespace

double ContactTime(const RobotDescription& robot) {
  return 0.02 / std::sqrt(robot.virtual_robot.ground.stiffness_factor);
}

std::string Mjcf(const RobotDescription& robot) { return Writer(robot).Write(); }

}  // namespace plumb
