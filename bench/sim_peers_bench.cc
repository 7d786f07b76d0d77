// The simulator's peers, in the same run as sim_bench.cc: MuJoCo 2.2.2 (where libmujoco-dev is
// installed) and Simbody the textbook way.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <memory>

#include "bench/sim_motions.h"
#include "sim/simulator.h"
#include "sim/virtual/mujoco_backend.h"
#include "sim/virtual/simbody_plant.h"
#ifdef PLUMB_MUJOCO
#include "tests/sim/mujoco_hopper.h"
#endif

namespace plumb {
namespace {

/// The virtual robot's dynamics, asked every 5 ms: Simbody the textbook way.
void SimbodyPendulumFiveMilliseconds(benchmark::State& state) {
  const Model model(Load("pendulum"));
  SimbodyPlant plant(model.Describe(model.parameters().means()));
  plant.SetState(kOne, kOne);
  double seconds = 0;
  for (auto _ : state) {
    plant.Advance(kOne, 0.005);
    seconds += 0.005;
  }
  state.counters["x_real_time"] = benchmark::Counter(seconds, benchmark::Counter::kIsRate);
}
BENCHMARK(SimbodyPendulumFiveMilliseconds);

/// The time of a step if Simbody's own mass matrix and bias were all there is to it: once instead
/// of four times.
void SimbodyHopperMassAndBias(benchmark::State& state) {
  RobotDescription robot = Load("hopper/gym.toml");
  SimbodyPlant plant(Model(robot).Describe(Model(robot).parameters().means()));
  ForEachHop(state, [&](const auto& q, const auto& v, const auto&) {
    plant.SetState(q, v);
    benchmark::DoNotOptimize(plant.MassMatrix().data());
    benchmark::DoNotOptimize(plant.Bias().data());
  });
}
BENCHMARK(SimbodyHopperMassAndBias);

#ifdef PLUMB_MUJOCO
void MujocoHopperStep(benchmark::State& state, MujocoHopper::Integrator integrator) {
  MujocoHopper mujoco(integrator);
  ForEachHop(state, [&](const auto& q, const auto& v, const auto& effort) {
    std::copy_n(q.data(), 6, mujoco.data()->qpos);
    std::copy_n(v.data(), 6, mujoco.data()->qvel);
    mujoco.ControlStep(effort.tail(3) / 200);
  });
}
BENCHMARK_CAPTURE(MujocoHopperStep, RK4, MujocoHopper::Integrator::kRungeKutta);
BENCHMARK_CAPTURE(MujocoHopperStep, Euler, MujocoHopper::Integrator::kEuler);

// 20 ms of a quadruped on its feet: ten substeps each.
RobotDescription Quadruped() {
  RobotDescription robot = Load("quadruped");
  robot.parameters.clear();
  return robot;
}

Eigen::VectorXd Standing(const RobotDescription& robot) {
  Eigen::VectorXd q = Eigen::VectorXd::Zero(robot.num_positions());
  q[2] = 0.3, q[3] = 1;
  for (Eigen::Index i = 7; i < q.size(); ++i)
    q[i] = robot.joints[static_cast<size_t>(i - 3)].dynamics.rest;
  return q;
}

/// Whose feet may also touch each other and a step beside it.
RobotDescription TouchingQuadruped() {
  RobotDescription robot = Quadruped();
  Shape step{.type = Shape::Type::kBox, .size = {1, 1, 0.1}};
  step.position = {0.8, 0, 0.05};
  robot.links[0].collisions = {step};
  robot.simulation.link_pairs = {{"*_calf", "*_calf"}, {"world", "*_calf"}};
  return robot;
}

void QuadrupedStep(benchmark::State& state, RobotDescription (*make)()) {
  const RobotDescription robot = make();
  Simulator simulator(robot);
  const Eigen::VectorXd q = Standing(robot), none = Eigen::VectorXd::Zero(18);
  for (auto _ : state) {
    simulator.SetState(q, none);
    for (int i = 0; i < 50; ++i) simulator.Step(none, 0.02);
  }
  state.SetItemsProcessed(state.iterations() * 50);
}
BENCHMARK_CAPTURE(QuadrupedStep, OnTheGround, Quadruped);
BENCHMARK_CAPTURE(QuadrupedStep, WithPairs, TouchingQuadruped);

void MujocoQuadrupedStep(benchmark::State& state, RobotDescription (*make)()) {
  const RobotDescription robot = make();
  const auto mujoco = MakeMujocoBackend(robot);
  const Eigen::VectorXd q = Standing(robot), none = Eigen::VectorXd::Zero(18);
  for (auto _ : state) {
    mujoco->SetState(q, none);
    for (int i = 0; i < 50; ++i) mujoco->Advance(none, 0.02);
  }
  state.SetItemsProcessed(state.iterations() * 50);
}
BENCHMARK_CAPTURE(MujocoQuadrupedStep, OnTheGround, Quadruped);
BENCHMARK_CAPTURE(MujocoQuadrupedStep, WithPairs, TouchingQuadruped);

void MujocoHopperMasses(benchmark::State& state) {
  MujocoHopper mujoco;
  for (auto _ : state) mujoco.SetMasses({3.6, 4.1, 2.7, 5.3});
}
BENCHMARK(MujocoHopperMasses);

/// One step of 0.05 s of a rod on a hinge, by Euler's method.
void MujocoPendulumStep(benchmark::State& state) {
  constexpr char kXml[] = R"(
    <mujoco>
      <option timestep="0.05" gravity="0 0 -10" integrator="Euler"/>
      <worldbody>
        <body>
          <joint name="pivot" type="hinge" axis="0 1 0"/>
          <inertial pos="0 0 .5" mass="1" diaginertia=".083333333 .083333333 1e-9"/>
        </body>
      </worldbody>
      <actuator><motor joint="pivot" gear="2"/></actuator>
    </mujoco>)";
  const auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
  mj_makeEmptyFileVFS(files.get(), "rod.xml", sizeof(kXml) - 1);
  std::copy_n(kXml, sizeof(kXml) - 1, static_cast<char*>(files->filedata[0]));
  char error[1000] = "";
  mjModel* model = mj_loadXML("rod.xml", files.get(), error, sizeof(error));
  if (!model) return state.SkipWithError(error);
  mjData* data = mj_makeData(model);
  data->qpos[0] = 1;
  data->ctrl[0] = 0.15;
  for (auto _ : state) mj_step(model, data);
  mj_deleteData(data);
  mj_deleteModel(model);
  mj_deleteVFS(files.get());
}
BENCHMARK(MujocoPendulumStep);
#endif

}  // namespace
}  // namespace plumb
