#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/config.h"
#include "robot/parameter_kinds.h"

namespace plumb {

/// [simulation]: how the equations of motion are integrated, and the world around the robot.
struct SimulationSettings {
  /// kSemiImplicit: v += h a(q, v); q += h v, as gym does. kLeapfrog: q += h/2 v; v += h a; q +=
  /// h/2 v.
  enum class Integrator { kSemiImplicit, kLeapfrog };
  Integrator integrator;
  double substep;  ///< [s] a step is divided evenly into such, or up to a tenth longer ones
  double latency;  ///< [s] in training: the previous action acts that long into a step
  /// [rad/s] velocities are clipped to this after each substep; infinity = no clip
  double speed_clip;
  /// gym v0 moves the position with the speed before clipping it; false = with the clipped one.
  bool move_before_clip;
  double gravity = kStandardGravity;  ///< [m/s^2] >= 0, along -z of the base

  using Contact = ContactOf<double>;
  using Stop = StopOf<double>;
  std::optional<Contact> contact;  ///< none: the robot does not touch the ground
  std::optional<Stop> stop;        ///< none: joints move on beyond their limits

  bool meshes = true;  ///< collision meshes touch the ground, too

  /// Links that touch each other, by names that may have the wildcards of fnmatch(3), of which none
  /// stands for a slash.
  struct LinkPair {
    std::string first, second;
    std::string place = {};  ///< of it in the file, for messages
  };
  std::vector<LinkPair> link_pairs = {};  ///< see ContactPairs

  /// The numbers among these that may be uncertain parameters.
  World world() const { return {gravity, contact.value_or(Contact{}), stop.value_or(Stop{})}; }
  /// Sets them; contact and stops that the robot does not have stay away.
  void set_world(const World& world);
  bool Has(WorldParameterKind::Table table) const;
};

/// @param period [s] of control, which a substep must not exceed. Thread-safe. @throws ConfigError
SimulationSettings ReadSimulation(Config config, double period);

}  // namespace plumb
