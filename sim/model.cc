#include "sim/model.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <stdexcept>
#include <vector>

#include "sim/parameters.h"
#include "sim/tree.h"

namespace plumb {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// A rigid body or several joined together, seen from the world's origin, and the force that moves it.
struct Composite {
  double mass;
  Vector3d first_moment;  // mass times centre of mass
  Matrix3d inertia;       // about the world's origin
  Vector3d moment;        // needed about the world's origin for the accelerations without joint accelerations
  Vector3d force;

  void operator+=(const Composite& other) {
    mass += other.mass;
    first_moment += other.first_moment;
    inertia += other.inertia;
    moment += other.moment;
    force += other.force;
  }
};

Composite SeenFromOrigin(const InertialModel::Body& body, const LinkMotion& link, double gravity) {
  Composite c;
  const Vector3d arm = link.rotation * body.center_of_mass;
  const Vector3d center = link.position + arm;
  const Matrix3d inertia = link.rotation * body.inertia * link.rotation.transpose();
  const Vector3d& omega = link.angular_velocity;
  const Vector3d acceleration =
      link.linear_bias + link.angular_bias.cross(arm) + omega.cross(omega.cross(arm));
  c.mass = body.mass;
  c.first_moment = body.mass * center;
  c.inertia = inertia - body.mass * center * center.transpose();
  c.inertia.diagonal().array() += body.mass * center.squaredNorm();
  c.force = body.mass * (acceleration + gravity * Vector3d::UnitZ());
  c.moment = inertia * link.angular_bias + omega.cross(inertia * omega) + center.cross(c.force);
  return c;
}

}  // namespace

class Simulator::Impl {
 public:
  explicit Impl(const RobotDescription& description)
      : parameters_(description),
        inertias_(parameters_.Nominal()),
        tree_(description),
        settings_(description.simulation),
        composites_(tree_.parents().size()),
        q_(Eigen::VectorXd::Zero(description.num_joints())),
        v_(q_),
        acceleration_(q_),
        mass_matrix_(Eigen::MatrixXd::Zero(q_.size(), q_.size())),
        cholesky_(q_.size()) {
    if (!(settings_.substep > 0)) throw std::invalid_argument("the simulation's substep must be positive");
  }

  void SetState(const Vector& q, const Vector& v) {
    if (q.size() != q_.size() || v.size() != v_.size()) {
      throw std::invalid_argument("a state has " + std::to_string(q_.size()) + " positions and velocities");
    }
    if (!q.allFinite() || !v.allFinite()) throw std::invalid_argument("a simulator's state must be finite");
    q_ = q;
    v_ = v;
    finite_ = true;
  }

  void Step(const Vector& effort, double duration) {
    if (!(duration > 0)) return;
    // The slack keeps 0.05 / 0.005 at ten substeps whatever the rounding.
    const double count = std::max(1.0, std::ceil(duration / settings_.substep - 1e-6));
    const double h = duration / count;
    for (double i = 0; i < count && finite_; ++i) Substep(effort, h);
  }

  /// Leaves `acceleration_` non-finite where the state or the effort is, or Simbody gives up on huge numbers.
  void Accelerate(const Vector& effort) {
    acceleration_.setConstant(std::numeric_limits<double>::quiet_NaN());
    if (!q_.allFinite() || !v_.allFinite()) return;
    try {
      Solve(tree_.Update(q_, v_), effort);
    } catch (const std::exception&) {
      // Simbody's checks of its own intermediate results.
    }
  }

  Parameters parameters_;
  InertialModel inertias_;
  Tree tree_;
  SimulationSettings settings_;
  std::vector<Composite> composites_;
  Eigen::VectorXd q_, v_;
  Eigen::VectorXd acceleration_;
  Eigen::MatrixXd mass_matrix_;
  Eigen::LLT<Eigen::MatrixXd> cholesky_;
  bool finite_ = true;

 private:
  void Solve(const std::vector<LinkMotion>& links, const Vector& effort) {
    const std::vector<int>& parents = tree_.parents();
    for (size_t i = 0; i < links.size(); ++i) {
      composites_[i] = SeenFromOrigin(inertias_.bodies[i], links[i], inertias_.gravity);
    }
    for (size_t j = links.size(); j-- > 0;) {
      const Composite& c = composites_[j];
      const LinkMotion& moved = links[j];
      // Momentum of everything beyond joint j when it moves with unit velocity; only ancestors feel it.
      const Vector3d linear = c.mass * moved.slide + moved.axis.cross(c.first_moment);
      const Vector3d angular = c.inertia * moved.axis + c.first_moment.cross(moved.slide);
      const auto column = static_cast<Eigen::Index>(j);
      for (int i = static_cast<int>(j); i >= 0; i = parents[static_cast<size_t>(i)]) {
        const LinkMotion& ancestor = links[static_cast<size_t>(i)];
        mass_matrix_(column, i) = ancestor.axis.dot(angular) + ancestor.slide.dot(linear);
      }
      acceleration_[column] = effort[column] - moved.axis.dot(c.moment) - moved.slide.dot(c.force);
      if (parents[j] >= 0) composites_[static_cast<size_t>(parents[j])] += c;
    }
    cholesky_.compute(mass_matrix_);  // reads the lower triangle only; joints on other branches stay zero
    cholesky_.solveInPlace(acceleration_);
  }

  void Substep(const Vector& effort, double h) {
    const bool leapfrog = settings_.integrator == SimulationSettings::Integrator::kLeapfrog;
    if (leapfrog) q_ += h / 2 * v_;
    Accelerate(effort);
    v_ += h * acceleration_;
    if (!settings_.move_before_clip) Clip();
    q_ += (leapfrog ? h / 2 : h) * v_;
    if (settings_.move_before_clip) Clip();
    finite_ = q_.allFinite() && v_.allFinite();
  }

  void Clip() {
    if (std::isinf(settings_.speed_clip)) return;
    // std::clamp passes NaN on, unlike Eigen's min and max.
    for (double& v : v_) v = std::clamp(v, -settings_.speed_clip, settings_.speed_clip);
  }
};

Simulator::Simulator(const RobotDescription& description) : impl_(std::make_unique<Impl>(description)) {}
Simulator::Simulator(Simulator&&) noexcept = default;
Simulator& Simulator::operator=(Simulator&&) noexcept = default;
Simulator::~Simulator() = default;

int Simulator::num_joints() const { return static_cast<int>(impl_->q_.size()); }
int Simulator::parameter_count() const { return impl_->parameters_.size(); }

void Simulator::SetParameters(const Vector& physical) {
  impl_->parameters_.Apply(physical, impl_->inertias_);
}
void Simulator::SetState(const Vector& q, const Vector& v) { impl_->SetState(q, v); }
void Simulator::Step(const Vector& effort, double duration) { impl_->Step(effort, duration); }

void Simulator::Step(std::span<const EffortSegment> profile) {
  for (const EffortSegment& segment : profile) impl_->Step(segment.effort, segment.duration);
}

const Eigen::VectorXd& Simulator::q() const { return impl_->q_; }
const Eigen::VectorXd& Simulator::v() const { return impl_->v_; }
bool Simulator::finite() const { return impl_->finite_; }

const Eigen::VectorXd& Simulator::Acceleration(const Vector& effort) {
  impl_->Accelerate(effort);
  return impl_->acceleration_;
}

}  // namespace plumb
