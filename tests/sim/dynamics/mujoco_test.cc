// Our HopperInTheAir against MuJoCo's, where the two solve the same equations: in free flight.
#include <catch2/catch.hpp>

#include "sim/simulator.h"
#include "tests/sim/mujoco_hopper.h"
#include "tests/sim/trees.h"

namespace plumb {
namespace {

using MujocoState = MujocoHopper::State;

RobotDescription HopperInTheAir() {
  RobotDescription hopper = LoadExample("hopper/gym.toml");
  for (JointDescription& joint : hopper.joints) joint.dynamics.delay = 0;
  return hopper;
}

}  // namespace

TEST_CASE("mujoco: the hopper's bodies weigh what MuJoCo makes of their shapes") {
  const MujocoHopper theirs;
  const RobotDescription ours = HopperInTheAir();
  for (int i = 0; i < 4; ++i) {
    const LinkDescription& link = ours.links[static_cast<size_t>(i) + 3];
    INFO(link.name);
    CHECK(link.mass == Approx(theirs.published_masses()[i]).epsilon(1e-13).margin(0));
    CHECK((link.center_of_mass - theirs.center_of_mass(i)).norm() < 1e-15);
    const Eigen::Matrix3d axes = theirs.principal_axes(i);
    const Eigen::Matrix3d inertia = axes * theirs.inertias().col(i).asDiagonal() * axes.transpose();
    CHECK((link.inertia - inertia).norm() < 1e-13 * inertia.norm());
  }
  CHECK(ours.simulation.gravity == theirs.gravity());
}

TEST_CASE("mujoco: in flight a time step is MuJoCo's own") {
  MujocoHopper theirs(MujocoHopper::Integrator::kEuler);
  RobotDescription description = HopperInTheAir();
  REQUIRE(description.simulation.integrator == SimulationSettings::Integrator::kSemiImplicit);
  description.simulation.substep = MujocoHopper::kTimeStep;
  REQUIRE(description.parameters.size() == 4);  // torso, thigh, leg, foot
  Simulator ours(description);
  Random random(1);
  double worst = 0;
  int flights = 0;
  for (int tries = 0; flights < 2000; ++tries) {
    REQUIRE(tries < 100'000);
    Eigen::Vector4d masses;
    for (double& mass : masses) mass = random.Uniform(1, 9);
    MujocoState q = MujocoState::Zero(), v;
    q << random.Uniform(-5, 5), random.Uniform(5, 9), random.Uniform(-3, 3),
        random.Uniform(-2.5, -0.1), random.Uniform(-2.5, -0.1), random.Uniform(-0.7, 0.7);
    for (double& speed : v) speed = random.Uniform(-10, 10);
    Eigen::Vector3d action;
    for (double& entry : action) entry = random.Uniform(-1, 1);
    theirs.SetMasses(masses);
    theirs.SetState(q, v);
    theirs.Step(action);
    if (theirs.active_constraints() > 0) continue;  // folded up so far that it hits itself
    ++flights;
    Eigen::VectorXd effort = Eigen::VectorXd::Zero(6);
    effort.tail<3>() = 200 * action;
    ours.SetParameters(masses);
    ours.SetState(q, v);
    ours.Step(effort, MujocoHopper::kTimeStep);
    worst = std::max({worst, (ours.q() - theirs.q()).cwiseAbs().maxCoeff(),
                      (ours.v() - theirs.v()).cwiseAbs().maxCoeff()});
  }
  CHECK(worst < 1e-12);
}

TEST_CASE("mujoco: a flight of a second is MuJoCo's") {
  MujocoHopper theirs(MujocoHopper::Integrator::kEuler);
  RobotDescription description = HopperInTheAir();
  description.simulation.substep = MujocoHopper::kTimeStep;
  Simulator ours(description);
  ours.SetParameters(theirs.published_masses());
  MujocoState q, v;
  q << 0, 20, 0.3, -1, -1, 0.1;
  v << 1, 5, -2, 0.5, -0.5, 1;
  theirs.SetState(q, v);
  ours.SetState(q, v);
  Random random(2);
  Eigen::VectorXd effort = Eigen::VectorXd::Zero(6);
  int steps = 0;
  for (; steps < 500; ++steps) {
    Eigen::Vector3d action;
    for (int k = 0; k < 3; ++k)
      action[k] = 0.2 * (std::array{-1.2, -1.2, 0.0}[static_cast<size_t>(k)] - ours.q()[3 + k]) +
                  random.Uniform(-0.2, 0.2);
    effort.tail<3>() = 200 * action;
    theirs.Step(action);
    ours.Step(effort, MujocoHopper::kTimeStep);
    if (theirs.active_constraints() > 0) break;
  }
  CHECK(steps == 500);
  CHECK((ours.q() - theirs.q()).norm() < 1e-9);
}

TEST_CASE("mujoco: a hopper at rest on the ground is held by it") {
  MujocoHopper theirs;
  MujocoState q, v = MujocoState::Zero();
  q << 0, 1.2, 0, 0, 0, 0;  // 1 cm deep
  theirs.SetState(q, v);
  theirs.Step(Eigen::Vector3d::Zero());
  CHECK(theirs.active_constraints() > 0);
  CHECK(theirs.contacts() == 2);  // both ends of the foot
  CHECK_FALSE(theirs.reset_itself());
  theirs.SetState(MujocoState::Constant(1e300), v);
  theirs.Step(Eigen::Vector3d::Zero());
  CHECK(theirs.reset_itself());
}

namespace {

/// How far one control step of ours is from MuJoCo's own (Runge-Kutta), root mean square over the
/// six velocities.
struct Gap {
  double squared = 0, moved = 0;
  int steps = 0;
  double rms() const { return std::sqrt(squared / steps / 6); }
  double rms_change() const { return std::sqrt(moved / steps / 6); }
};

struct Gaps {
  Gap contact, limit, free;
};

// From states that MuJoCo visits under random actions of this amplitude; episodes end with a fall,
// or after 100 steps.
Gaps MeasureGaps(double amplitude, bool end_with_fall) {
  MujocoHopper theirs;
  RobotDescription description = HopperInTheAir();
  description.parameters.clear();
  Simulator ours(description);
  Random random(5);
  Gaps gaps;
  for (int episode = 0; episode < 40; ++episode) {
    MujocoState q = MujocoState::Zero(), v;
    q[1] = 1.25;
    for (int i = 0; i < 6; ++i)
      q[i] += random.Uniform(-.005, .005), v[i] = random.Uniform(-.005, .005);
    for (int step = 0; step < 100; ++step) {
      Eigen::Vector3d action;
      for (double& entry : action) entry = random.Uniform(-amplitude, amplitude);
      Eigen::VectorXd effort = Eigen::VectorXd::Zero(6);
      effort.tail<3>() = 200 * action;
      theirs.SetState(q, v);
      theirs.ControlStep(action);
      ours.SetState(q, v);
      ours.Step(effort, 0.008);
      Gap& gap = theirs.contacts() > 0             ? gaps.contact
                 : theirs.active_constraints() > 0 ? gaps.limit
                                                   : gaps.free;
      ++gap.steps;
      gap.squared += (ours.v() - theirs.v()).squaredNorm();
      gap.moved += (theirs.v() - v).squaredNorm();
      q = theirs.q();
      v = theirs.v();
      if (end_with_fall && (q[1] < .7 || std::abs(q[2]) > .2)) break;
    }
  }
  return gaps;
}

}  // namespace

// Contact is another model than MuJoCo's, so there is a gap. These bounds are what a simulator of
// linearly implicit contact was measured to differ by when its constants were chosen on a coarse
// grid; ours must not be further away.
TEST_CASE("mujoco: in contact and at the stops ours is near") {
  const struct {
    double amplitude, contact, limit, free;
  } bounds[] = {{0.3, 0.123, 0.140, 0.018}, {1, 0.326, 0.454, 0.042}};
  for (const auto& bound : bounds) {
    for (const bool end_with_fall : {true, false}) {
      const Gaps gaps = MeasureGaps(bound.amplitude, end_with_fall);
      INFO("amplitude " << bound.amplitude
                        << (end_with_fall ? ", until the fall" : ", lying on the ground, too"));
      INFO("contact " << gaps.contact.rms() << " of " << gaps.contact.rms_change() << ", limit "
                      << gaps.limit.rms() << " of " << gaps.limit.rms_change() << ", free "
                      << gaps.free.rms() << " of " << gaps.free.rms_change()
                      << " m/s or rad/s per control step");
      CHECK(gaps.contact.steps > 300);
      CHECK(gaps.contact.rms() < bound.contact);
      CHECK(gaps.limit.rms() < bound.limit);
      CHECK(gaps.free.rms() < bound.free);
      if (end_with_fall) {  // and of how much a step changes
        CHECK(gaps.contact.rms() < 0.2 * gaps.contact.rms_change());
        CHECK(gaps.limit.rms() < 0.32 * gaps.limit.rms_change());
        CHECK(gaps.free.rms() < 0.05 * gaps.free.rms_change());
      }
    }
  }
}

}  // namespace plumb
