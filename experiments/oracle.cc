#include "experiments/oracle.h"

#include <optional>

#include "trainer/checkpoint.h"

namespace plumb {
namespace {

void Resume(Trainer& trainer, uint64_t seed, uint64_t identity, const std::string& file) {
  const std::optional<Checkpoint> checkpoint = LoadCheckpoint(file);
  if (!checkpoint) return;
  if (checkpoint->identity != identity || checkpoint->seed != seed)
    throw CheckpointError(
        file + ": of another robot, seed or version: delete it, or give another --output");
  trainer.Restore(TrainerStateOf(*checkpoint));
}

void Save(const TrainerState& state, uint64_t seed, uint64_t identity, const std::string& file) {
  Checkpoint checkpoint;
  SetTrainerState(state, checkpoint);
  checkpoint.seed = seed, checkpoint.identity = identity;
  SaveCheckpoint(file, checkpoint);
}

}  // namespace

Oracle TrainOracle(const RobotDescription& model, const SimulationFactory& reality, uint64_t seed,
                   int threads, const std::string& checkpoint, uint64_t identity,
                   const std::function<void(double)>& progress) {
  Trainer trainer(model.training, reality, model.effort_limits(), seed, threads);
  Resume(trainer, seed, identity, checkpoint);
  const ParameterSampler itself = [](Random&) { return SimulatorDraw(Eigen::VectorXd()); };
  const auto patience_left = [&] {
    const TrainerState state = trainer.state();
    return state.updates - (state.best ? state.best->updates : 0) < kPatience;
  };
  while (trainer.updates() < kMostUpdates && patience_left()) {
    for (int i = 0; i < kBetween; ++i) {
      trainer.Update(itself);
      progress(static_cast<double>(trainer.updates()) / kMostUpdates);
    }
    trainer.Judge(itself);
    Save(trainer.state(), seed, identity, checkpoint);
  }
  const int64_t updates = trainer.updates();
  trainer.ReturnToBest(itself);
  return {trainer.policy(), updates, trainer.steps()};
}

double ShareOfOracle(double value, double oracle) {
  return oracle > 0 ? value / oracle : oracle / value;
}

}  // namespace plumb
