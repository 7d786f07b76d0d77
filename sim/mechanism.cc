#include "sim/mechanism.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

namespace plumb {

Mechanism::Mechanism(const RobotDescription& robot) {
  for (const JointDescription& joint : robot.joints) {
    if (joint.dynamics.sensor_delay != 0 || joint.dynamics.sensor_bias != 0) {
      throw std::invalid_argument("the virtual robot's encoders are right and on time, not like joint '" +
                                  joint.name + "' of the simulator's");
    }
  }
  if (Plant::Lacks(robot).empty()) {
    plant_ = std::make_unique<Plant>(robot);
    return;
  }
  RobotDescription fine = robot;
  fine.parameters.clear();
  fine.simulation.integrator = SimulationSettings::Integrator::kLeapfrog;
  fine.simulation.speed_clip = std::numeric_limits<double>::infinity();
  fine.simulation.substep = std::min(robot.simulation.substep / 10, kLongestSubstep);
  simulator_ = std::make_unique<Simulator>(fine);
}

void Mechanism::SetState(const Eigen::Ref<const Eigen::VectorXd>& q,
                         const Eigen::Ref<const Eigen::VectorXd>& v) {
  if (plant_) {
    plant_->SetState(q, v);
  } else {
    simulator_->SetState(q, v);
  }
}

bool Mechanism::Advance(const Eigen::Ref<const Eigen::VectorXd>& effort, double duration) {
  if (plant_) return plant_->Advance(effort, duration);
  if (!effort.allFinite()) return false;
  q_ = simulator_->q();
  v_ = simulator_->v();
  simulator_->Step(effort, duration);
  if (simulator_->finite()) return true;
  simulator_->SetState(q_, v_);
  return false;
}

}  // namespace plumb
