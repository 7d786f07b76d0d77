#include "robot/configuration_space.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "robot/rotation_vector.h"

namespace plumb {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

Quaterniond QuaternionAt(const ConfigurationSpace::Vector& q, Eigen::Index i) {
  return {q[i], q[i + 1], q[i + 2], q[i + 3]};
}

void Put(const Quaterniond& turn, Eigen::Index i, Eigen::Ref<Eigen::VectorXd> q) {
  q.segment<4>(i) << turn.w(), turn.x(), turn.y(), turn.z();
}

Vector3d TurnBetween(const ConfigurationSpace::Vector& a, const ConfigurationSpace::Vector& b,
                     Eigen::Index position) {
  return ToRotationVector(QuaternionAt(b, position).conjugate() * QuaternionAt(a, position));
}

}  // namespace

ConfigurationSpace::ConfigurationSpace(const RobotDescription& robot) {
  Eigen::Index position = 0;
  for (const JointDescription& joint : robot.joints) {
    const auto velocity = static_cast<Eigen::Index>(position_of_.size());
    if (joint.num_positions() == 1) {
      position_of_.push_back(position);
    } else {
      turns_.push_back({joint.name, position, velocity});
      position_of_.insert(position_of_.end(), 3, -1);
    }
    position += joint.num_positions();
  }
  num_positions_ = position;
  num_velocities_ = static_cast<Eigen::Index>(position_of_.size());
}

Eigen::VectorXd ConfigurationSpace::Difference(const Vector& a, const Vector& b) const {
  if (flat()) return a - b;
  Eigen::VectorXd difference(num_velocities_);
  for (Eigen::Index c = 0; c < num_velocities_; ++c) {
    const Eigen::Index at = position_of_[static_cast<size_t>(c)];
    if (at >= 0) difference[c] = a[at] - b[at];
  }
  for (const Turn& turn : turns_)
    difference.segment<3>(turn.velocity) = TurnBetween(a, b, turn.position);
  return difference;
}

double ConfigurationSpace::Difference(const Vector& a, const Vector& b, Eigen::Index c) const {
  if (const Eigen::Index at = position_of_[static_cast<size_t>(c)]; at >= 0) return a[at] - b[at];
  auto turn = turns_.begin();
  while (c >= turn->velocity + 3) ++turn;
  return TurnBetween(a, b, turn->position)[c - turn->velocity];
}

Eigen::VectorXd ConfigurationSpace::Coordinates(const Vector& q, const Vector& about) const {
  if (flat()) return q;
  Eigen::VectorXd coordinates(num_velocities_);
  for (Eigen::Index c = 0; c < num_velocities_; ++c) {
    const Eigen::Index at = position_of_[static_cast<size_t>(c)];
    if (at >= 0) coordinates[c] = q[at];
  }
  for (const Turn& turn : turns_)
    coordinates.segment<3>(turn.velocity) = TurnBetween(q, about, turn.position);
  return coordinates;
}

Eigen::VectorXd ConfigurationSpace::At(const Vector& coordinates, const Vector& about) const {
  if (flat()) return coordinates;
  Eigen::VectorXd q(num_positions_);
  for (Eigen::Index c = 0; c < num_velocities_; ++c) {
    const Eigen::Index at = position_of_[static_cast<size_t>(c)];
    if (at >= 0) q[at] = coordinates[c];
  }
  for (const Turn& turn : turns_) {
    Put((QuaternionAt(about, turn.position) *
         FromRotationVector(coordinates.segment<3>(turn.velocity)))
            .normalized(),
        turn.position, q);
  }
  return q;
}

Eigen::VectorXd ConfigurationSpace::Move(const Vector& q, const Vector& step) const {
  Eigen::VectorXd moved = q;
  MoveInPlace(step, moved);
  return moved;
}

void ConfigurationSpace::MoveInPlace(const Vector& step, Eigen::Ref<Eigen::VectorXd> q) const {
  for (Eigen::Index c = 0; c < num_velocities_; ++c) {
    const Eigen::Index at = position_of_[static_cast<size_t>(c)];
    if (at >= 0) q[at] += step[c];
  }
  for (const Turn& turn : turns_) {
    Put((QuaternionAt(q, turn.position) * FromRotationVector(step.segment<3>(turn.velocity)))
            .normalized(),
        turn.position, q);
  }
}

void ConfigurationSpace::Move(Eigen::Index c, double by, Eigen::Ref<Eigen::VectorXd> q) const {
  if (const Eigen::Index at = position_of_[static_cast<size_t>(c)]; at >= 0) {
    q[at] += by;
    return;
  }
  auto turn = turns_.begin();
  while (c >= turn->velocity + 3) ++turn;
  const Vector3d step = by * Vector3d::Unit(c - turn->velocity);
  Put((QuaternionAt(q, turn->position) * FromRotationVector(step)).normalized(), turn->position, q);
}

std::string ConfigurationSpace::Normalise(const Vector& like, Eigen::Ref<Eigen::VectorXd> q) const {
  for (const Turn& turn : turns_) {
    auto quaternion = q.segment<4>(turn.position);
    const double length = quaternion.norm();
    if (std::isnan(length)) continue;
    if (!(std::abs(length - 1) <= kRounded)) return Fault(turn.joint, quaternion);
    quaternion /= quaternion.dot(like.segment<4>(turn.position)) < 0 ? -length : length;
  }
  return {};
}

std::string ConfigurationSpace::Fault(const std::string& joint, const Eigen::Vector4d& quaternion) {
  return fmt::format("of {} ({:.4g}, {:.4g}, {:.4g}, {:.4g}) is no unit quaternion", joint,
                     quaternion[0], quaternion[1], quaternion[2], quaternion[3]);
}

bool ConfigurationSpace::Has(const Vector& q) const {
  return q.size() == num_positions_ && q.allFinite() &&
         std::ranges::all_of(turns_, [&](const Turn& turn) { return IsUnit(q, turn); });
}

bool ConfigurationSpace::IsUnit(const Vector& q, const Turn& turn) {
  return std::abs(q.segment<4>(turn.position).norm() - 1) <= kUnit;
}

std::string ConfigurationSpace::Fault(const Vector& q) const {
  if (Has(q)) return {};
  if (q.size() != num_positions_)
    return fmt::format("has {} entries, not {}", q.size(), num_positions_);
  for (const Turn& turn : turns_) {
    if (!IsUnit(q, turn)) return Fault(turn.joint, q.segment<4>(turn.position));
  }
  return "is not finite";
}

}  // namespace plumb
