#include "sim/virtual/fine_simulator.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/simulator.h"

namespace plumb {
namespace {

class FineSimulator : public PhysicsBackend {
 public:
  explicit FineSimulator(const RobotDescription& robot) : simulator_(Finer(robot)) {}

  void SetState(const Vector& q, const Vector& v) override { simulator_.SetState(q, v); }
  bool Advance(const Vector& effort, double duration) override {
    if (!effort.allFinite()) return false;
    q_ = simulator_.q();
    v_ = simulator_.v();
    simulator_.Step(effort, duration);
    if (simulator_.finite()) return true;
    simulator_.SetState(q_, v_);
    return false;
  }
  const Eigen::VectorXd& q() const override { return simulator_.q(); }
  const Eigen::VectorXd& v() const override { return simulator_.v(); }

 private:
  static RobotDescription Finer(RobotDescription robot) {
    robot.parameters.clear();
    if (auto& contact = robot.simulation.contact) {
      const double factor = robot.virtual_robot.ground.stiffness_factor;
      contact->stiffness *= factor;
      contact->damping *= std::sqrt(factor);  // as many periods to come to rest
    }
    robot.simulation.integrator = SimulationSettings::Integrator::kLeapfrog;
    robot.simulation.speed_clip = std::numeric_limits<double>::infinity();
    robot.simulation.substep = std::min(robot.simulation.substep / 10, kLongestSubstep);
    return robot;
  }

  Simulator simulator_;
  Eigen::VectorXd q_, v_;  // where it was
};

}  // namespace

std::unique_ptr<PhysicsBackend> MakeFineSimulator(const RobotDescription& robot) {
  return std::make_unique<FineSimulator>(robot);
}

}  // namespace plumb
