#pragma once

#include <Eigen/Core>
#include <memory>

#include "robot/configuration_space.h"
#include "robot/description.h"
#include "sim/dynamics/engine.h"
#include "sim/dynamics/topology.h"
#include "sim/parameters.h"

namespace plumb {

/// Beyond this many rad, m, rad/s or m/s a simulation has failed: it has blown up.
inline constexpr double kFarthest = 1e6;

/// A robot that can be simulated: how it hangs together, and what its parameters do to it.
/// Immutable, hence thread-safe: one for all workers.
class Model {
 public:
  /// @throws std::invalid_argument if the joints do not form a tree, a parameter is unknown or not
  /// physical, or a joint moves neither mass nor armature.
  explicit Model(const RobotDescription& description);

  const RobotDescription& description() const { return description_; }
  const ConfigurationSpace& space() const { return space_; }
  const Topology& topology() const { return topology_; }
  const Parameters& parameters() const { return parameters_; }
  int num_positions() const { return topology_.positions; }
  int num_velocities() const { return topology_.velocities; }

  /// The equations that step the robot, with the prior means as parameters in all lanes.
  /// The model must outlive it.
  std::unique_ptr<Engine> NewEngine() const;
  std::unique_ptr<Engine> NewWideEngine() const;

  /// The description of the robot with these parameters: what another simulator of it has to be
  /// built from.
  /// @throws std::invalid_argument, see Parameters::Apply.
  RobotDescription Describe(const Eigen::Ref<const Eigen::VectorXd>& physical) const;

 private:
  void RequireInertia() const;

  RobotDescription description_;
  ConfigurationSpace space_;
  Topology topology_;
  Parameters parameters_;
};

}  // namespace plumb
