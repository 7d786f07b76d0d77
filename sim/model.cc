#include "sim/model.h"

#include <cmath>
#include <stdexcept>

#include "common/decompositions.h"
#include "robot/contact_pairs.h"
#include "robot/contact_points.h"

namespace plumb {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

std::string JointOfVelocity(const Model& model, Eigen::Index velocity) {
  std::string name;
  for (size_t i = 0; i < model.topology().joints.size(); ++i) {
    if (model.topology().joints[i].velocity <= velocity) name = model.description().joints[i].name;
  }
  return name;
}

std::unique_ptr<Engine> WithPhysics(std::unique_ptr<Engine> engine,
                                    const Physics<double>& physics) {
  engine->SetPhysics(physics);
  return engine;
}

Vector3d Vector(const double* numbers) { return Vector3d::Map(numbers); }

// Masses, and where joints are and how they turn.
void DescribeLinks(const Topology& topology, const Physics<double>& physics,
                   RobotDescription* robot) {
  for (size_t i = 0; i < robot->joints.size(); ++i) {
    const Physics<double>::Link& now = physics.links[i];
    const Matrix3d& axes = topology.link_axes[i + 1];
    LinkDescription& link = robot->links[i + 1];
    link.mass = now.mass;
    link.center_of_mass = axes.transpose() * Vector(now.center);
    Matrix3d inertia;
    inertia << now.inertia[0], now.inertia[3], now.inertia[4],  //
        now.inertia[3], now.inertia[1], now.inertia[5],         //
        now.inertia[4], now.inertia[5], now.inertia[2];
    link.inertia = axes.transpose() * inertia * axes;
    JointDescription& joint = robot->joints[i];
    joint.origin =
        topology.link_axes[static_cast<size_t>(joint.parent)].transpose() * Vector(now.origin);
    joint.dynamics = physics.axes[static_cast<size_t>(topology.joints[i].velocity)];
  }
}

// Balls where points touch the ground; but meshes, and what touches other links, stay what they
// are.
void DescribePoints(const Topology& topology, const Physics<double>& physics,
                    const ContactPairs& touching, RobotDescription* robot) {
  std::vector<bool> touches(robot->links.size());
  for (const ContactPairs::Solid& at : touching.solids)
    touches[static_cast<size_t>(at.link)] = true;
  size_t point = 0;
  for (size_t i = 1; i < robot->links.size(); ++i) {
    std::vector<Shape> shapes;
    for (Shape shape : robot->links[i].collisions) {
      const size_t count = ContactSpheres(shape).size();
      for (size_t k = 0; k < count; ++k) {
        const Physics<double>::Point& now = physics.points[point++];
        const Vector3d centre = topology.link_axes[i].transpose() * Vector(now.position);
        if (shape.type == Shape::Type::kMesh) {
          shape.corners[k] = shape.rotation.transpose() * (centre - shape.position);
        } else if (!touches[i]) {
          shapes.push_back({.position = centre, .size = Vector3d(now.radius, 0, 0)});
        }
      }
      if (touches[i] || shape.type == Shape::Type::kMesh) shapes.push_back(std::move(shape));
    }
    robot->links[i].collisions = std::move(shapes);
  }
}

// Shapes that may touch those of other links.
void DescribeSolids(const Topology& topology, const Physics<double>& physics,
                    const ContactPairs& touching, RobotDescription* robot) {
  for (size_t i = 0; i < touching.solids.size(); ++i) {
    const auto link = static_cast<size_t>(touching.solids[i].link);
    const Physics<double>::Solid& now = physics.solids[i];
    Shape& shape = robot->links[link].collisions[touching.solids[i].shape];
    shape.position = topology.link_axes[link].transpose() * Vector(now.position);
    if (shape.type == Shape::Type::kBox) shape.size = 2 * Vector(now.half);
    if (shape.type == Shape::Type::kCapsule) shape.size.y() = 2 * now.half[2];
  }
}

}  // namespace

Model::Model(const RobotDescription& description)
    : description_(description),
      space_(description),
      topology_(description),
      parameters_(description, topology_) {
  RequireInertia();
}

std::unique_ptr<Engine> Model::NewEngine() const {
  return WithPhysics(MakeEngine(topology_, description_.simulation, parameters_.terms()),
                     parameters_.Nominal());
}

std::unique_ptr<Engine> Model::NewWideEngine() const {
  return WithPhysics(MakeWideEngine(topology_, description_.simulation, parameters_.terms()),
                     parameters_.Nominal());
}

// A mass matrix that can be inverted at a generic position can be at almost all of them.
void Model::RequireInertia() const {
  const std::unique_ptr<Engine> engine = NewEngine();
  const int n = num_velocities();
  for (int i = 0; i < num_positions(); ++i) engine->q()[i] = 0.3 + 0.7 * std::sin(1.0 + i);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::MatrixXd mass = RowMajor::Map(engine->MassMatrix(), n, n);
  mass = mass.selfadjointView<Eigen::Lower>();
  for (int i = 0; i < n; ++i) {
    if (!(mass(i, i) < 1e100)) {
      throw std::invalid_argument("what joint '" + JointOfVelocity(*this, i) +
                                  "' moves is too heavy or too long to be simulated");
    }
    if (!(mass(i, i) > 0)) {
      throw std::invalid_argument("joint '" + JointOfVelocity(*this, i) +
                                  "' moves neither mass nor armature");
    }
  }
  // In units of the diagonal, so that metres and radians compare.
  const Eigen::VectorXd scale = mass.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modes(
      Eigen::MatrixXd(scale.asDiagonal() * mass * scale.asDiagonal()));
  if (modes.info() != Eigen::Success || !(modes.eigenvalues()(0) > 1e-12)) {
    Eigen::Index worst = 0;
    if (modes.info() == Eigen::Success) modes.eigenvectors().col(0).cwiseAbs().maxCoeff(&worst);
    throw std::invalid_argument(
        "joint '" + JointOfVelocity(*this, worst) +
        "' and those it is in line with move no mass of their own: their mass matrix is singular");
  }
}

RobotDescription Model::Describe(const Eigen::Ref<const Eigen::VectorXd>& physical) const {
  Physics<double> physics = parameters_.Nominal();
  parameters_.Apply(physical, &physics);
  RobotDescription robot = description_;
  robot.parameters.clear();
  robot.frozen.clear();
  robot.virtual_robot.hidden.clear();
  robot.simulation.set_world(physics.world);
  DescribeLinks(topology_, physics, &robot);
  const ContactPairs touching = FindContactPairs(description_);
  if (robot.simulation.contact) DescribePoints(topology_, physics, touching, &robot);
  DescribeSolids(topology_, physics, touching, &robot);
  return robot;
}

}  // namespace plumb
