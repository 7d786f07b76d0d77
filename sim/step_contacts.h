#pragma once

#include <Eigen/Core>
#include <vector>

#include "sim/model.h"
#include "sim/simulator.h"

namespace plumb {

/// What touched the ground, and which joints their stops, in a control step, and how: by what the
/// residual functions of contacts know a step (Residual::ground, stop). Not thread-safe; does not
/// allocate after construction.
class StepContacts {
 public:
  /// A contact point of the ground, with k = 2 directions (upwards, and along the ground) of robots
  /// that move in a plane and 3 of others, or a joint at a stop, with k = 1, away from it.
  struct Contact {
    bool ground;  ///< else a joint's stop
    /// Inputs. Of a point its height and velocity (k entries) when the step began, the same at its
    /// end as the simulator has it, what contacts, stops and friction made of its velocity, and the
    /// k (k + 1) / 2 entries of `mobility`. Of a joint its distance from the stop and its velocity
    /// when the step began, the same at its end, and what they made of the velocity.
    /// [m, m/s, 1/kg; rad, rad/s]
    Eigen::VectorXd x;
    Eigen::MatrixXd jacobian;  ///< k x n, J: its velocity by those of the joints
    Eigen::MatrixXd mobility;  ///< k x k, A = J M^-1 J': its change of velocity by an impulse
    /// n x k, M^-1 J' A^-1: change of the joints' velocities if an impulse there changes its own
    /// velocity by one
    Eigen::MatrixXd response;
  };

  /// @param margin [m], [rad] >= 0: as near as this counts as touching.
  StepContacts(const Model& model, double margin);

  /// Before the simulator makes the step.
  void Begin(Simulator& simulator);
  /// After it and Simulator::Acceleration. @param constrained what stops, contacts and Coulomb
  /// friction made of each velocity.
  void End(Simulator& simulator, const Eigen::Ref<const Eigen::VectorXd>& constrained);
  /// Those that touched when the step began or, in the simulator, at its end. After End.
  const std::vector<const Contact*>& touching() const { return touching_; }

  /// How near everything is that can be touched, where it is near, when the step began: what it
  /// does depends on millimetres there, and on nothing farther away. With distances in margins,
  /// kept within kReach: of each contact point its height and, as far as it is near, its velocity
  /// [m/s]; of each joint with stops its distance from the middle between them, of which most is
  /// taken away. The margin must be above zero.
  /// @param nearness NearnessCount() entries.
  void Nearness(Eigen::Ref<Eigen::VectorXd> nearness) const;
  static constexpr double kReach = 4;

  // Sizes. Thread-safe.
  static int GroundInputs(const Topology& topology);
  static constexpr int kStopInputs = 5;
  static int NearnessCount(const RobotDescription& robot, const Topology& topology);

 private:
  struct Stop {
    Eigen::Index position, velocity;  // in q and v
    double lower, upper;
  };
  void Look(Simulator& simulator, Eigen::VectorXd* heights, Eigen::MatrixXd* velocities);
  bool Respond(Simulator& simulator, Contact* contact);

  double margin_;
  Eigen::Index directions_;
  std::vector<Stop> stops_;
  std::vector<Contact> points_, joints_;
  std::vector<const Contact*> touching_;
  Eigen::VectorXd q_, v_;                         // when the step began
  Eigen::VectorXd heights_, next_heights_;        // of points
  Eigen::MatrixXd velocities_, next_velocities_;  // k x points
  Simulator::RowMajorMatrix jacobians_;           // of points
  Eigen::VectorXd impulse_;
};

}  // namespace plumb
