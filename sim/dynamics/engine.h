#pragma once

#include <memory>

#include "sim/dynamics/physics.h"
#include "sim/dynamics/topology.h"

namespace plumb {

/// One robot, or several with other parameters side by side ("lanes"), that are stepped together.
/// Arrays hold for each coordinate its value in every lane: [coordinate * lanes() + lane]. Not
/// thread-safe. Apart from its making nothing allocates, and nothing throws: what is not finite
/// stays so.
class Engine {
 public:
  virtual ~Engine() = default;

  virtual int lanes() const = 0;
  /// @param physics of sizes that fit the topology.
  virtual void SetPhysics(int lane, const Physics<double>& physics) = 0;
  /// The same in all lanes.
  virtual void SetPhysics(const Physics<double>& physics) = 0;
  virtual double* q() = 0;
  virtual double* v() = 0;

  // As in Stepper. h: one per lane.
  virtual void Substep(const double* h, const double* effort, const double* moment) = 0;
  virtual const double* Acceleration(const double* effort) = 0;
  virtual const double* MassMatrix() = 0;
  virtual const double* Bias() = 0;
  virtual const double* ContactHeights() = 0;
  virtual const double* ContactJacobians() = 0;
  virtual const double* Response(const double* impulse) = 0;
  virtual void FromReading(const double* effort) = 0;
  virtual void ToReading(const double* effort) = 0;
};

/// The topology must outlive the engine; the physics is to be set. One lane.
std::unique_ptr<Engine> MakeEngine(const Topology& topology, const SimulationSettings& settings,
                                   const Terms& terms);
/// As many lanes as this processor computes at once: 2, 4 or 8. Every lane's results have the bits
/// of MakeEngine's.
std::unique_ptr<Engine> MakeWideEngine(const Topology& topology, const SimulationSettings& settings,
                                       const Terms& terms);

}  // namespace plumb
