#pragma once

#include <Eigen/Core>
#include <memory>

#include "robot/description.h"
#include "sim/plant.h"
#include "sim/simulator.h"

namespace plumb {

/// What moves in a virtual robot: a Plant, or, where the robot has something that a Plant has not (armature,
/// stops, contact), a Simulator with substeps a tenth as long as calibration's and at most kLongestSubstep:
/// then reality has the simulator's equations, but not its integration errors: what a model of contact gets
/// wrong does not show there. Not thread-safe.
class Mechanism {
 public:
  static constexpr double kLongestSubstep = 1e-4;  ///< [s]

  /// @param robot with known parameters, see Model::Describe.
  /// @throws std::invalid_argument if it cannot be simulated.
  explicit Mechanism(const RobotDescription& robot);

  /// @throws std::invalid_argument if an entry is not finite or the size is wrong.
  void SetState(const Eigen::Ref<const Eigen::VectorXd>& q, const Eigen::Ref<const Eigen::VectorXd>& v);
  /// Holds `effort` for `duration` [s] >= 0. A state that would not be finite is not taken on. @return false
  /// then.
  bool Advance(const Eigen::Ref<const Eigen::VectorXd>& effort, double duration);

  const Eigen::VectorXd& q() const { return plant_ ? plant_->q() : simulator_->q(); }
  const Eigen::VectorXd& v() const { return plant_ ? plant_->v() : simulator_->v(); }

 private:
  std::unique_ptr<Plant> plant_;  // one of the two
  std::unique_ptr<Simulator> simulator_;
  Eigen::VectorXd q_, v_;  // where it was
};

}  // namespace plumb
