// Cost of the simulator beside that of gym's closed form: build/bench/sim_bench [--benchmark_filter=...]
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "common/random.h"
#include "sim/environment.h"
#include "sim/simulator.h"
#include "sim/plant.h"

namespace plumb {
namespace {

RobotDescription Load(const std::string& file) {
  return LoadRobot(PLUMBLINE_SOURCE "/robots/pendulum/" + file);
}

const Eigen::VectorXd kOne = Eigen::VectorXd::Constant(1, 0.7);

void GymFormula(benchmark::State& state) {
  double q = 2, v = 0, u = 0.7, g = 10, m = 1, l = 1;
  for (auto _ : state) {
    benchmark::DoNotOptimize(u);
    benchmark::DoNotOptimize(g);
    v = std::clamp(v + 0.05 * (3 * g / (2 * l) * std::sin(q) + 3 / (m * l * l) * u), -8.0, 8.0);
    q += 0.05 * v;
    benchmark::DoNotOptimize(q);
  }
}
BENCHMARK(GymFormula);

void OneSubstep(benchmark::State& state) {
  const RobotDescription description = Load("robot.toml");
  Simulator simulator(description);
  simulator.SetState(kOne, kOne);
  for (auto _ : state) simulator.Step(kOne, description.simulation.substep);
}
BENCHMARK(OneSubstep);

void ControlStep(benchmark::State& state, const char* file) {
  Environment environment(Load(file));
  Random random(1);
  environment.Reset(random);
  const Eigen::VectorXf action = Eigen::VectorXf::Constant(1, 0.3f);
  for (auto _ : state) benchmark::DoNotOptimize(environment.Step(action));
}
BENCHMARK_CAPTURE(ControlStep, gym, "gym.toml");
BENCHMARK_CAPTURE(ControlStep, robot, "robot.toml");

void SetParameters(benchmark::State& state) {
  Simulator simulator(Load("robot.toml"));
  const Eigen::VectorXd physical = Eigen::Vector3d(10, 1, 1);
  for (auto _ : state) simulator.SetParameters(physical);
}
BENCHMARK(SetParameters);

void SetState(benchmark::State& state) {
  Simulator simulator(Load("robot.toml"));
  for (auto _ : state) simulator.SetState(kOne, kOne);
}
BENCHMARK(SetState);

/// The virtual robot's dynamics, asked every 5 ms; items/s is the multiple of real time.
void PlantFiveMilliseconds(benchmark::State& state) {
  const Model model(Load("robot.toml"));
  Plant plant(model.Describe(model.parameters().means()));
  plant.SetState(kOne, kOne);
  double seconds = 0;
  for (auto _ : state) {
    plant.Advance(kOne, 0.005);
    seconds += 0.005;
  }
  state.counters["x_real_time"] = benchmark::Counter(seconds, benchmark::Counter::kIsRate);
}
BENCHMARK(PlantFiveMilliseconds);

}  // namespace
}  // namespace plumb

