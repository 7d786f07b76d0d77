#pragma once

#include <Eigen/Core>
#include <memory>

#include "robot/residual.h"
#include "sim/simulator.h"
#include "sim/step_contacts.h"
#include "sim/tasks/task.h"

namespace plumb {

/// Entries of a step's inputs. Thread-safe, as is the next one.
int ResidualInputCount(const RobotDescription& robot);
/// @throws std::invalid_argument if the residual has other inputs or outputs than the robot.
void RequireResidualOf(const RobotDescription& robot, const Residual& residual);

/// By what a residual knows a control step: D entries,
///   the task's observation of the state it begins with,
///   the mean effort of each driven joint, in units of its limit,
///   the same of the step before: a drive may be late,
///   what stops, contacts and Coulomb friction made of each velocity in the simulator, nearly:
///   v' - v - T a, with the acceleration a that there is without them at the step's end,
///   what is near (StepContacts::Nearness),
/// and what it touched, by contacts().
/// Not thread-safe; does not allocate after construction.
class ResidualInputs {
 public:
  /// @param margin see StepContacts.
  ResidualInputs(const Model& model, double margin);

  int size() const { return static_cast<int>(x_.size()); }

  /// Before the simulator makes the step.
  void Begin(Simulator& simulator);
  /// After it. @param effort, before mean of the step and of the one before it, num_velocities
  /// entries [Nm or N]. @param duration [s] T.
  void End(Simulator& simulator, const Eigen::Ref<const Eigen::VectorXd>& effort,
           const Eigen::Ref<const Eigen::VectorXd>& before, double duration);

  // Of the step that has ended:
  const Eigen::VectorXd& x() const { return x_; }
  /// Whether it touched the ground or a stop, at its beginning or, in the simulator, at its end.
  bool touching() const { return !contacts_.touching().empty(); }
  const StepContacts& contacts() const { return contacts_; }

 private:
  std::unique_ptr<Task> task_;
  Eigen::VectorXd limits_;  // of the driven joints
  StepContacts contacts_;
  Eigen::VectorXf observation_;
  Eigen::VectorXd v_;  // that the step begins with
  Eigen::VectorXd acceleration_, constrained_, x_;
};

}  // namespace plumb
