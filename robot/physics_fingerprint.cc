#include "robot/physics_fingerprint.h"

#include "common/hash.h"

namespace plumb {
namespace {

class Fingerprint {
 public:
  void Add(double number) {
    if (number == 0) number = 0;  // -0 is the same physics
    value_ = Hash(&number, sizeof number, value_);
  }
  void Add(const std::string& text) {
    Add(static_cast<double>(text.size()));
    value_ = Hash(text, value_);
  }
  template <class Derived>
  void Add(const Eigen::DenseBase<Derived>& numbers) {
    for (Eigen::Index j = 0; j < numbers.cols(); ++j) {
      for (Eigen::Index i = 0; i < numbers.rows(); ++i) Add(static_cast<double>(numbers(i, j)));
    }
  }
  uint64_t value() const { return value_; }

 private:
  uint64_t value_ = kEmptyHash;
};

// Kinds that came later count where a joint has them: older posteriors still fit their robots.
constexpr size_t kFirstKinds = 10;

void AddLink(const LinkDescription& link, Fingerprint* hash) {
  hash->Add(link.name), hash->Add(link.mass), hash->Add(link.center_of_mass),
      hash->Add(link.inertia);
  for (const Shape& shape : link.collisions) {
    hash->Add(static_cast<double>(shape.type));
    hash->Add(shape.position), hash->Add(shape.rotation), hash->Add(shape.size);
    for (const Eigen::Vector3d& corner : shape.corners) hash->Add(corner);
  }
}

void AddJoint(const JointDescription& joint, Fingerprint* hash) {
  hash->Add(joint.name);
  hash->Add(joint.origin), hash->Add(joint.rotation), hash->Add(joint.axis);
  for (const double number : {static_cast<double>(joint.type), static_cast<double>(joint.parent),
                              joint.lower, joint.upper, joint.effort_limit}) {
    hash->Add(number);
  }
  constexpr JointDynamics kDefault;
  for (size_t i = 0; i < std::size(kJointParameterKinds); ++i) {
    const JointParameterKind& kind = kJointParameterKinds[i];
    const double number = joint.dynamics.*kind.member;
    if (i >= kFirstKinds && number == kDefault.*kind.member) continue;
    if (i >= kFirstKinds) hash->Add(kind.name);
    hash->Add(number);
  }
}

void AddSimulation(const SimulationSettings& s, Fingerprint* hash) {
  for (const double number : {static_cast<double>(s.integrator), s.substep, s.speed_clip,
                              static_cast<double>(s.move_before_clip), s.gravity}) {
    hash->Add(number);
  }
  hash->Add(s.contact ? "contact" : "");
  if (s.contact) {
    for (const double number :
         {s.contact->stiffness, s.contact->damping, s.contact->friction, s.contact->slip_speed}) {
      hash->Add(number);
    }
  }
  for (const SimulationSettings::LinkPair& pair : s.link_pairs)
    hash->Add(pair.first), hash->Add(pair.second);
  hash->Add(s.stop ? "stop" : "");
  if (s.stop) hash->Add(s.stop->stiffness), hash->Add(s.stop->damping);
  // Later than the rest, and so only where it is not 0; of a table it says when efforts act.
  if (s.latency != 0) hash->Add("latency"), hash->Add(s.latency);
}

}  // namespace

uint64_t PhysicsFingerprint(const RobotDescription& robot) {
  Fingerprint hash;
  for (const LinkDescription& link : robot.links) AddLink(link, &hash);
  for (const JointDescription& joint : robot.joints) AddJoint(joint, &hash);
  for (const FrozenParameter& frozen : robot.frozen) hash.Add(frozen.name), hash.Add(frozen.value);
  AddSimulation(robot.simulation, &hash);
  return hash.value();
}

}  // namespace plumb
