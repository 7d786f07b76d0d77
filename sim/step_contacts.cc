#include "sim/step_contacts.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace plumb {
namespace {

// Of the mobility's trace: what keeps its inverse finite where a point cannot move each way.
constexpr double kNugget = 1e-6;
constexpr double kLeastMobility = 1e-9;  // [1/kg], of a stop [1/(kg m^2)]

// At most 3 x 3: does not allocate.
using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 3, 3>;

bool HasStop(const RobotDescription& robot, const JointDescription& joint) {
  return robot.simulation.stop && joint.type != JointDescription::Type::kSpherical &&
         (std::isfinite(joint.lower) || std::isfinite(joint.upper));
}

// k (k + 1) / 2 entries
void WriteLower(const Eigen::MatrixXd& matrix, Eigen::Ref<Eigen::VectorXd> entries) {
  Eigen::Index entry = 0;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) entries[entry++] = matrix(i, j);
  }
}

}  // namespace

int StepContacts::GroundInputs(const Topology& topology) {
  const int k = topology.contact_directions();
  return 2 * (1 + k) + k + k * (k + 1) / 2;
}

int StepContacts::NearnessCount(const RobotDescription& robot, const Topology& topology) {
  const auto stops = std::count_if(robot.joints.begin(), robot.joints.end(),
                                   [&](const auto& joint) { return HasStop(robot, joint); });
  return static_cast<int>(topology.points.size()) * (1 + topology.contact_directions()) +
         static_cast<int>(stops);
}

StepContacts::StepContacts(const Model& model, double margin)
    : margin_(margin),
      directions_(model.topology().contact_directions()),
      q_(model.num_positions()),
      v_(model.num_velocities()),
      heights_(static_cast<Eigen::Index>(model.topology().points.size())),
      next_heights_(heights_),
      velocities_(directions_, heights_.size()),
      next_velocities_(velocities_),
      jacobians_(directions_ * heights_.size(), v_.size()),
      impulse_(v_.size()) {
  const Eigen::Index n = v_.size(), k = directions_;
  const Contact point{true, Eigen::VectorXd(GroundInputs(model.topology())), Eigen::MatrixXd(k, n),
                      Eigen::MatrixXd(k, k), Eigen::MatrixXd(n, k)};
  const Contact stop{false, Eigen::VectorXd(kStopInputs), Eigen::MatrixXd::Zero(1, n),
                     Eigen::MatrixXd(1, 1), Eigen::MatrixXd(n, 1)};
  points_.assign(static_cast<size_t>(heights_.size()), point);
  const RobotDescription& robot = model.description();
  for (size_t i = 0; i < robot.joints.size(); ++i) {
    const JointDescription& joint = robot.joints[i];
    if (HasStop(robot, joint))
      stops_.push_back({model.topology().joints[i].position, model.topology().joints[i].velocity,
                        joint.lower, joint.upper});
  }
  joints_.assign(stops_.size(), stop);
  touching_.reserve(points_.size() + joints_.size());
}

void StepContacts::Look(Simulator& simulator, Eigen::VectorXd* heights,
                        Eigen::MatrixXd* velocities) {
  simulator.ContactPoints(heights, &jacobians_);
  for (Eigen::Index p = 0; p < heights->size(); ++p) {
    velocities->col(p) =
        jacobians_.middleRows(p * directions_, directions_).lazyProduct(simulator.v());
  }
}

void StepContacts::Begin(Simulator& simulator) {
  q_ = simulator.q(), v_ = simulator.v();
  if (!points_.empty()) Look(simulator, &heights_, &velocities_);
}

void StepContacts::End(Simulator& simulator, const Eigen::Ref<const Eigen::VectorXd>& constrained) {
  touching_.clear();
  const Eigen::Index k = directions_;
  if (!points_.empty()) Look(simulator, &next_heights_, &next_velocities_);
  for (Eigen::Index p = 0; p < heights_.size(); ++p) {
    if (!(std::min(heights_[p], next_heights_[p]) <= margin_)) continue;
    Contact& contact = points_[static_cast<size_t>(p)];
    contact.jacobian = jacobians_.middleRows(p * k, k);
    if (!Respond(simulator, &contact)) continue;
    contact.x[0] = heights_[p];
    contact.x.segment(1, k) = velocities_.col(p);
    contact.x[1 + k] = next_heights_[p];
    contact.x.segment(2 + k, k) = next_velocities_.col(p);
    contact.x.segment(2 + 2 * k, k) = contact.jacobian.lazyProduct(constrained);
    WriteLower(contact.mobility, contact.x.tail(k * (k + 1) / 2));
    touching_.push_back(&contact);
  }
  for (size_t s = 0; s < stops_.size(); ++s) {
    const auto [position, velocity, lower, upper] = stops_[s];
    const double q = simulator.q()[position];
    const bool low = q - lower < upper - q;
    const double stop = low ? lower : upper, away = low ? 1 : -1;
    if (!(std::min(away * (q_[position] - stop), away * (q - stop)) <= margin_)) continue;
    Contact& contact = joints_[s];
    contact.jacobian(0, velocity) = away;
    if (!Respond(simulator, &contact)) continue;
    contact.x << away * (q_[position] - stop), away * v_[velocity], away * (q - stop),
        away * simulator.v()[velocity], away * constrained[velocity];
    touching_.push_back(&contact);
  }
}

// Mobility and response of its Jacobian. @return false if nothing moves the point: no contact can
// act on the robot there.
bool StepContacts::Respond(Simulator& simulator, Contact* contact) {
  Eigen::MatrixXd& response = contact->response;  // M^-1 J' at first
  for (Eigen::Index i = 0; i < contact->jacobian.rows(); ++i) {
    impulse_ = contact->jacobian.row(i).transpose();
    simulator.ImpulseResponse(impulse_, response.col(i));
  }
  contact->mobility = contact->jacobian.lazyProduct(response);
  if (!(contact->mobility.trace() > kLeastMobility)) return false;
  Small loaded = contact->mobility;
  loaded.diagonal().array() += kNugget * loaded.trace();
  const Eigen::LLT<Small> factor(loaded);
  factor.matrixU().solveInPlace<Eigen::OnTheRight>(response);
  factor.matrixL().solveInPlace<Eigen::OnTheRight>(response);
  return true;
}

void StepContacts::Nearness(Eigen::Ref<Eigen::VectorXd> nearness) const {
  const auto distance = [&](double metres) {
    return std::clamp(metres / margin_, -kReach, kReach);
  };
  Eigen::Index i = 0;
  for (Eigen::Index p = 0; p < heights_.size(); ++p) {
    const double height = distance(heights_[p]);
    nearness[i] = height;
    nearness.segment(i + 1, directions_) =
        std::clamp(kReach - height, 0.0, 1.0) * velocities_.col(p);
    i += 1 + directions_;
  }
  for (const Stop& stop : stops_)
    nearness[i++] =
        distance(q_[stop.position] - stop.lower) - distance(stop.upper - q_[stop.position]);
}

}  // namespace plumb
