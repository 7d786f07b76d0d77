#include "experiments/oracle.h"

namespace plumb {

Oracle TrainOracle(const RobotDescription& model, const SimulationFactory& reality, uint64_t seed,
                   int threads, const std::function<void(double)>& progress) {
  Trainer trainer(model.training, reality, model.effort_limits(), seed, threads);
  const ParameterSampler itself = [](Random&) { return SimulatorDraw(Eigen::VectorXd()); };
  for (int64_t best = 0;
       trainer.updates() < kMostUpdates && trainer.updates() - best < kPatience;) {
    for (int i = 0; i < kBetween; ++i) {
      trainer.Update(itself);
      progress(static_cast<double>(trainer.updates()) / kMostUpdates);
    }
    trainer.Judge(itself);
    if (const TrainerState state = trainer.state(); state.best) best = state.best->updates;
  }
  const int64_t updates = trainer.updates();
  trainer.ReturnToBest(itself);
  return {trainer.policy(), updates, trainer.steps()};
}

double ShareOfOracle(double value, double oracle) {
  return oracle > 0 ? value / oracle : oracle / value;
}

}  // namespace plumb
