#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sim/simulator.h"

namespace plumb {

/// Steps simulators of one model side by side, in the lanes of a wide engine: each gets the bits of
/// its own Step, in a fraction of the time. One per worker; not thread-safe.
class SimulatorLanes {
 public:
  /// @param model the simulators', shared with them.
  explicit SimulatorLanes(std::shared_ptr<const Model> model);

  /// Simulators that are stepped at once: 2, 4 or 8, as the processor can. More are stepped one
  /// group after the other.
  int count() const { return static_cast<int>(lanes_); }

  /// @param simulator has prepared a step (Simulator::Prepare), and stays where it is until Run.
  /// @throws std::invalid_argument if it is of another model.
  void Add(Simulator& simulator);
  /// Runs the steps of those added since the last time.
  void Run();

 private:
  void Run(std::span<Simulator* const> simulators);

  std::shared_ptr<const Model> model_;
  std::unique_ptr<Engine> engine_;
  size_t lanes_;
  std::vector<uint64_t> robots_;           // whose parameters each lane has
  std::vector<double> lengths_;            // [lane]: of a substep
  std::vector<double> efforts_, moments_;  // [velocity][lane]
  std::vector<Simulator*> added_;
};

}  // namespace plumb
