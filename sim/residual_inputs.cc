#include "sim/residual_inputs.h"

#include <span>
#include <stdexcept>

#include "sim/tasks/task.h"

namespace plumb {

int ResidualInputCount(const RobotDescription& robot) {
  const std::unique_ptr<Task> task = MakeTask(robot);
  return task->observation_size() + 2 * task->action_size() + robot.num_velocities() +
         TouchFinder(robot).num_nearness();
}

void RequireResidualOf(const RobotDescription& robot, const Residual& residual) {
  for (const auto* part : {&residual.free, &residual.touching}) {
    if (*part && ((*part)->inputs() != ResidualInputCount(robot) ||
                  (*part)->outputs() != 2 * robot.num_velocities()))
      throw std::invalid_argument(
          "the residual is another robot's: it has other inputs or outputs");
  }
  for (const Eigen::VectorXd& draw : residual.coordinates) {
    if (draw.size() != static_cast<Eigen::Index>(robot.parameters.size()))
      throw std::invalid_argument("the residual is another robot's: it has other parameters");
  }
}

ResidualInputs::ResidualInputs(const Model& model, double margin)
    : task_(MakeTask(model.description())),
      limits_(task_->action_size()),
      touch_(model.description(), margin),
      observation_(task_->observation_size()),
      v_(model.num_velocities()),
      acceleration_(v_.size()),
      x_(ResidualInputCount(model.description())) {
  if (model.num_positions() != model.num_velocities())
    throw std::invalid_argument("a residual is not for robots with spherical joints");
  const Eigen::VectorXd all = model.description().effort_limits();
  for (Eigen::Index a = 0; a < limits_.size(); ++a) limits_[a] = all[a];
}

void ResidualInputs::Begin(const Simulator& simulator) {
  task_->Observe(simulator.q(), simulator.v(),
                 std::span(observation_.data(), static_cast<size_t>(observation_.size())));
  x_.head(observation_.size()) = observation_.cast<double>();
  v_ = simulator.v();
  touching_ = touch_.Nearness(simulator.q(), simulator.v(), x_.tail(touch_.num_nearness())).any();
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
  x_.segment(observation_.size() + 2 * actions, v_.size()) =
      simulator.v() - v_ - duration * acceleration_;
  touching_ = touching_ || touch_.Find(simulator.q()).any();
}

}  // namespace plumb
