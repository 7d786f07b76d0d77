// The pieces of a TRPO update at the size robots/pendulum asks for. Argument: threads.
#include <benchmark/benchmark.h>

#include <vector>

#include "tests/trainer/pendulum.h"
#include "trainer/critic.h"
#include "trainer/trainer.h"
#include "trainer/trpo.h"

namespace plumb {
namespace {

const PolicyShape kShape{3, {128, 128}, 1};

GaussianPolicy FreshPolicy() {
  return Trainer(PendulumSettings(), MakeGymPendulum, Eigen::VectorXd::Constant(1, 2), 1, 1)
      .policy();
}

/// A batch with random advantages.
struct Samples {
  explicit Samples(Workers& workers) {
    RolloutSampler rollout(MakeGymPendulum, kShape, workers);
    batch = rollout.Collect(FreshPolicy(), GymParameters, PendulumSettings().batch, 1, 1, 1, 1);
    Random random(1);
    for (int i = 0; i < batch.size(); ++i) advantages.push_back(random.Normal());
  }
  PolicySamples View() const { return {batch.observations, batch.actions, advantages}; }
  Batch batch;
  std::vector<double> advantages;
};

/// One Fisher-vector product; second argument k: at every k-th sample.
void FisherProduct(benchmark::State& state) {
  Workers workers(static_cast<int>(state.range(0)));
  const Samples samples(workers);
  TrainingSettings settings = PendulumSettings();
  settings.fisher_fraction = 1. / static_cast<double>(state.range(1));
  const GaussianPolicy policy = FreshPolicy();
  Trpo trpo(settings, kShape, workers);
  trpo.PrepareFisher(policy, samples.View());
  for (auto _ : state) benchmark::DoNotOptimize(trpo.FisherProduct(policy.parameters));
}
BENCHMARK(FisherProduct)
    ->ArgsProduct({{1, 2}, {1, 5}})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

/// A policy's step; second argument k: Fisher's matrix at every k-th sample.
void PolicyStep(benchmark::State& state) {
  Workers workers(static_cast<int>(state.range(0)));
  const Samples samples(workers);
  TrainingSettings settings = PendulumSettings();
  settings.fisher_fraction = 1. / static_cast<double>(state.range(1));
  Trpo trpo(settings, kShape, workers);
  const GaussianPolicy fresh = FreshPolicy();
  for (auto _ : state) {
    GaussianPolicy policy = fresh;
    benchmark::DoNotOptimize(trpo.Improve(policy, samples.View()).kl);
  }
}
BENCHMARK(PolicyStep)
    ->ArgsProduct({{1, 2}, {1, 5}})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

void CriticFit(benchmark::State& state) {
  Workers workers(static_cast<int>(state.range(0)));
  const Samples samples(workers);
  Critic critic(PendulumSettings(), kShape.observations, Random(1), workers);
  Random random(2);
  for (auto _ : state) critic.Fit(samples.batch.observations, samples.advantages, random);
}
BENCHMARK(CriticFit)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();

void CollectBatch(benchmark::State& state) {
  Workers workers(static_cast<int>(state.range(0)));
  RolloutSampler rollout(MakeGymPendulum, kShape, workers);
  const GaussianPolicy policy = FreshPolicy();
  uint32_t number = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        rollout.Collect(policy, GymParameters, PendulumSettings().batch, 1, 1, 1, number++).size());
  }
}
BENCHMARK(CollectBatch)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();

/// Everything: roll-out, policy, critic.
void Update(benchmark::State& state) {
  TrainingSettings settings = PendulumSettings();
  settings.fisher_fraction = 1. / static_cast<double>(state.range(1));
  Trainer trainer(settings, MakeGymPendulum, Eigen::VectorXd::Constant(1, 2), 1,
                  static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(trainer.Update(GymParameters).mean_return);
}
BENCHMARK(Update)
    ->ArgsProduct({{1, 2}, {1, 5}})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

}  // namespace
}  // namespace plumb
