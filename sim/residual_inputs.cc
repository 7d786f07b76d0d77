#include "sim/residual_inputs.h"

#include <span>
#include <stdexcept>

#include "sim/tasks/task.h"

namespace plumb {

int ResidualInputCount(const RobotDescription& robot) {
  const std::unique_ptr<Task> task = MakeTask(robot);
  return task->observation_size() + 2 * task->action_size() + robot.num_velocities() +
         StepContacts::NearnessCount(robot, Topology(robot));
}

void RequireResidualOf(const RobotDescription& robot, const Residual& residual) {
  const Topology topology(robot);
  const int inputs = ResidualInputCount(robot), directions = topology.contact_directions();
  const auto fits = [](const std::optional<ResidualFunction>& f, int d, int outputs) {
    return !f || (f->inputs() == d && f->outputs() == outputs);
  };
  if (!fits(residual.free, inputs, 2 * robot.num_velocities()) ||
      !fits(residual.touching, inputs, 2 * robot.num_velocities()) ||
      !fits(residual.ground, StepContacts::GroundInputs(topology), 2 * directions) ||
      !fits(residual.stop, StepContacts::kStopInputs, 2))
    throw std::invalid_argument("the residual is another robot's: it has other inputs or outputs");
  for (const Eigen::VectorXd& draw : residual.coordinates) {
    if (draw.size() != static_cast<Eigen::Index>(robot.parameters.size()))
      throw std::invalid_argument("the residual is another robot's: it has other parameters");
  }
}

ResidualInputs::ResidualInputs(const Model& model, double margin)
    : task_(MakeTask(model.description())),
      limits_(task_->action_size()),
      contacts_(model, margin),
      observation_(task_->observation_size()),
      v_(model.num_velocities()),
      acceleration_(v_.size()),
      constrained_(v_.size()),
      x_(ResidualInputCount(model.description())) {
  const Eigen::VectorXd all = model.description().effort_limits();
  for (Eigen::Index a = 0; a < limits_.size(); ++a) limits_[a] = all[a];
}

void ResidualInputs::Begin(Simulator& simulator) {
  task_->Observe(simulator.q(), simulator.v(),
                 std::span(observation_.data(), static_cast<size_t>(observation_.size())));
  x_.head(observation_.size()) = observation_.cast<double>();
  v_ = simulator.v();
  contacts_.Begin(simulator);
  contacts_.Nearness(x_.tail(x_.size() - observation_.size() - 2 * limits_.size() - v_.size()));
}

void ResidualInputs::End(Simulator& simulator, const Eigen::Ref<const Eigen::VectorXd>& effort,
                         const Eigen::Ref<const Eigen::VectorXd>& before, double duration) {
  const Eigen::Index actions = limits_.size();
  auto now = x_.segment(observation_.size(), actions);
  auto then = x_.segment(observation_.size() + actions, actions);
  for (Eigen::Index a = 0; a < actions; ++a) {
    const int joint = task_->action_indices()[static_cast<size_t>(a)];
    now[a] = effort[joint] / limits_[a];
    then[a] = before[joint] / limits_[a];
  }
  simulator.Acceleration(effort, &acceleration_);
  constrained_ = simulator.v() - v_ - duration * acceleration_;
  x_.segment(observation_.size() + 2 * actions, v_.size()) = constrained_;
  contacts_.End(simulator, constrained_);
}

}  // namespace plumb
