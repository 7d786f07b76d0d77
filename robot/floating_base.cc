#include "robot/floating_base.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "robot/contact_points.h"
#include "robot/joint_tree.h"

namespace plumb {
namespace {

using Type = JointDescription::Type;

constexpr double kParallel = 1e-9;

bool AtRightAngles(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::abs(a.dot(b)) < kParallel;
}

bool IsFree(const FloatingBase& base) {
  if (base.turned < 0 || base.slides.size() != (base.spatial ? 3 : 2)) return false;
  std::vector<Eigen::Vector3d> directions;
  for (const ImuMounting::Slide& slide : base.slides) directions.push_back(slide.direction);
  if (!base.spatial) {
    directions.push_back(base.normal());
    if (std::abs(directions.back().z()) >= kParallel) return false;
  }
  return AtRightAngles(directions[0], directions[1]) &&
         AtRightAngles(directions[0], directions[2]) && AtRightAngles(directions[1], directions[2]);
}

void Refuse(const std::string& why) { throw std::invalid_argument(why); }

}  // namespace

bool FloatingBase::Has(int joint) const {
  return joint == turned || std::any_of(slides.begin(), slides.end(),
                                        [&](const auto& slide) { return slide.joint == joint; });
}

FloatingBase FloatingBaseOf(const RobotDescription& robot) {
  const auto imu = std::find_if(robot.sensors.begin(), robot.sensors.end(),
                                [](const auto& sensor) { return sensor.link >= 0; });
  if (imu == robot.sensors.end()) Refuse("the robot has no IMU");
  const std::string& link = robot.links[static_cast<size_t>(imu->link)].name;
  FloatingBase base{.imu = static_cast<size_t>(imu - robot.sensors.begin()),
                    .link = imu->link,
                    .slides = {},
                    .turned = -1,
                    .spatial = false,
                    .axis = Eigen::Vector3d::UnitY(),
                    .zero = {}};
  for (const int index : ChainTo(robot, imu->link)) {
    const JointDescription& joint = robot.joints[static_cast<size_t>(index)];
    if (base.turned >= 0)
      Refuse(fmt::format("the IMU is on \"{}\", beyond the first joint that turns", link));
    if (!joint.passive)
      Refuse(fmt::format("the IMU is on \"{}\", beyond the motor of \"{}\"", link, joint.name));
    for (const SensorDescription& sensor : robot.sensors) {
      if (sensor.joint == index)
        Refuse(fmt::format("joint \"{}\" has an encoder, \"{}\"", joint.name, sensor.name));
    }
    base.zero.position += base.zero.rotation * joint.origin;
    base.zero.rotation *= joint.rotation;
    if (joint.type == Type::kPrismatic) {
      base.slides.push_back({index, base.zero.rotation * joint.axis});
      continue;
    }
    base.turned = index;
    base.spatial = joint.type == Type::kSpherical;
    base.axis = joint.axis;
  }
  if (!IsFree(base)) {
    Refuse(
        fmt::format("\"{}\" does not slide along two axes at right angles in an upright plane and "
                    "then turn about its normal, nor along three and then turn freely",
                    link));
  }
  const std::vector<ContactPoint> points = ContactPoints(robot);
  const auto moved = [&](const ContactPoint& point) {
    const std::vector<int> chain = ChainTo(robot, point.link);
    return std::find(chain.begin(), chain.end(), base.turned) != chain.end();
  };
  if (points.empty())
    Refuse(
        "nothing of it can touch the ground: no [simulation.contact], or no <collision> of "
        "spheres, capsules, boxes or meshes");
  if (points.size() > FloatingBase::kMaxPoints) {
    Refuse(fmt::format(
        "{} points can touch the ground, more than {}{}", points.size(), FloatingBase::kMaxPoints,
        robot.meshes.empty() ? "" : ": leave out meshes with simulation.contact.meshes"));
  }
  if (!std::all_of(points.begin(), points.end(), moved))
    Refuse("what touches the ground does not hang on the IMU's link");
  return base;
}

}  // namespace plumb
