#include "sim/simulator_lanes.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace plumb {

SimulatorLanes::SimulatorLanes(std::shared_ptr<const Model> model)
    : model_(std::move(model)),
      engine_(model_->NewWideEngine()),
      lanes_(static_cast<size_t>(engine_->lanes())),
      robots_(lanes_),
      lengths_(lanes_),
      efforts_(static_cast<size_t>(model_->num_velocities()) * lanes_),
      moments_(efforts_) {}

void SimulatorLanes::Add(Simulator& simulator) {
  if (simulator.model_ != model_)
    throw std::invalid_argument("simulators are stepped side by side if they share a model");
  if (simulator.prepared_.count > 0) added_.push_back(&simulator);
}

void SimulatorLanes::Run() {
  for (size_t begin = 0, end = 0; begin < added_.size(); begin = end) {
    const double substeps = added_[begin]->prepared_.count;
    while (end < added_.size() && end - begin < lanes_ && added_[end]->prepared_.count == substeps)
      ++end;
    Run({&added_[begin], end - begin});
  }
  added_.clear();
}

// All with as many substeps. Lanes that are left over do what the first one does.
void SimulatorLanes::Run(std::span<Simulator* const> simulators) {
  if (simulators.size() == 1) return simulators[0]->Run();
  const auto n = static_cast<size_t>(model_->num_velocities());
  const auto positions = static_cast<size_t>(model_->num_positions());
  const auto in_lane = [&](size_t lane) -> Simulator& {
    return *simulators[lane < simulators.size() ? lane : 0];
  };
  for (size_t lane = 0; lane < lanes_; ++lane) {
    Simulator& simulator = in_lane(lane);
    if (std::exchange(robots_[lane], simulator.robot_) != simulator.robot_)
      engine_->SetPhysics(static_cast<int>(lane), simulator.physics_);
    for (size_t i = 0; i < positions; ++i)
      engine_->q()[i * lanes_ + lane] = simulator.engine_->q()[i];
    for (size_t i = 0; i < n; ++i) engine_->v()[i * lanes_ + lane] = simulator.engine_->v()[i];
    lengths_[lane] = simulator.prepared_.length;
  }
  const double count = simulators[0]->prepared_.count;
  for (int64_t substep = 0; static_cast<double>(substep) < count; ++substep) {
    bool steady = true;
    for (Simulator* simulator : simulators) steady = simulator->FindEfforts(substep) && steady;
    for (size_t lane = 0; lane < lanes_; ++lane) {
      const Simulator& simulator = in_lane(lane);
      for (size_t i = 0; i < n; ++i) {
        efforts_[i * lanes_ + lane] = simulator.mean_[i];
        moments_[i * lanes_ + lane] = simulator.moment_[i];
      }
    }
    engine_->Substep(lengths_.data(), efforts_.data(), steady ? nullptr : moments_.data());
  }
  for (size_t lane = 0; lane < simulators.size(); ++lane) {
    Simulator& simulator = *simulators[lane];
    for (size_t i = 0; i < positions; ++i)
      simulator.engine_->q()[i] = engine_->q()[i * lanes_ + lane];
    for (size_t i = 0; i < n; ++i) simulator.engine_->v()[i] = engine_->v()[i * lanes_ + lane];
    simulator.Finish();
  }
}

}  // namespace plumb
