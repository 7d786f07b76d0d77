#include "tests/fuzz/simulate.h"

#include <algorithm>
#include <memory>
#include <stdexcept>

#include "sim/simulator.h"

namespace plumb {

SimulatorOutcome Simulate(const RobotDescription& robot) {
  std::unique_ptr<Simulator> simulator;
  try {
    simulator = std::make_unique<Simulator>(robot);
  } catch (const std::invalid_argument& error) {
    const std::string reason = error.what();
    if (reason.empty()) throw std::logic_error("the simulator does not say what is wrong");
    return {reason};
  }
  simulator->SetState(
      Eigen::Map<const Eigen::VectorXd>(robot.task.target.data(), robot.num_positions()),
      Eigen::VectorXd::Constant(robot.num_velocities(), 0.1));
  const Eigen::VectorXd effort = Eigen::VectorXd::Constant(robot.num_velocities(), 0.5);
  // Ten seconds in substeps of a microsecond are allowed, but not waited for.
  const double duration = std::min(robot.task.period, 5 * robot.simulation.substep);
  for (int i = 0; i < 3; ++i) simulator->Step(effort, duration);
  return {"", simulator->finite()};
}

}  // namespace plumb
