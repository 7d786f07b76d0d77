// Cost of the simulator beside its peers', in one run: build/bench/sim_bench
// [--benchmark_filter=...]
//   gym's closed form, MuJoCo 2.2.2 (where libmujoco-dev is installed) and Simbody the textbook
//   way.
// "allocations" is how often an iteration asks for memory.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "bench/sim_motions.h"
#include "calibrator/fit/residual_fit.h"
#include "common/random.h"
#include "sim/environment.h"
#include "sim/residual_inputs.h"
#include "sim/simulator.h"
#include "sim/simulator_lanes.h"
#include "sim/windows.h"

namespace plumb {
namespace {

// --- The pendulum
// -------------------------------------------------------------------------------------------------

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

void PendulumStep(benchmark::State& state, const char* file) {
  Environment environment(Load(file));
  Random random(1);
  environment.Reset(random);
  const Eigen::VectorXf action = Eigen::VectorXf::Constant(1, 0.3f);
  const CountAllocations count(state);
  for (auto _ : state) benchmark::DoNotOptimize(environment.Step(action));
}
BENCHMARK_CAPTURE(PendulumStep, gym, "pendulum/gym.toml");
BENCHMARK_CAPTURE(PendulumStep, robot, "pendulum");

// --- The hopper: from the states of random roll-outs, falls and all, one control step of 8 ms
// ----------------------

void Hopper(benchmark::State& state) {
  Simulator simulator(Load("hopper/gym.toml"));
  ForEachHop(state, [&](const auto& q, const auto& v, const auto& effort) {
    simulator.SetState(q, v);
    simulator.Step(effort, 0.008);
  });
}
BENCHMARK(Hopper);

/// As FitResidual makes them, of small numbers: the motion hardly changes.
std::shared_ptr<const Residual> LearntResidual(const RobotDescription& robot) {
  Random random(7);
  const auto normal = [&](Eigen::Index rows, Eigen::Index columns) {
    Eigen::MatrixXd matrix(rows, columns);
    for (double& number : matrix.reshaped()) number = random.Normal();
    return matrix;
  };
  const auto function = [&](Eigen::Index inputs, Eigen::Index outputs, Eigen::Index centres,
                            double noise) {
    ResidualFunction f;
    f.mean = Eigen::VectorXd::Zero(inputs), f.scale = Eigen::VectorXd::Ones(inputs);
    f.low = Eigen::VectorXd::Constant(inputs, -1), f.high = -f.low;
    f.centres = normal(centres, inputs) / 4;
    f.weights = {1e-3 * normal(outputs, f.features())};
    f.noise = noise * Eigen::MatrixXd::Identity(outputs, outputs);
    f.bound = Eigen::VectorXd::Ones(outputs);
    f.unknown = Eigen::VectorXd::Constant(outputs, 1e-3);
    return f;
  };
  const ResidualFitOptions sizes;
  const Topology topology(robot);
  const int inputs = ResidualInputCount(robot), outputs = 2 * robot.num_velocities();
  Residual residual;
  residual.coordinates = {
      Eigen::VectorXd::Zero(static_cast<Eigen::Index>(robot.parameters.size()))};
  residual.free = function(inputs, outputs, sizes.centres, 1e-3);
  residual.touching = function(inputs, outputs, sizes.rest_centres, 1e-3);
  residual.ground = function(StepContacts::GroundInputs(topology),
                             2 * topology.contact_directions(), sizes.contact_centres, 0);
  residual.stop = function(StepContacts::kStopInputs, 2, sizes.contact_centres, 0);
  return std::make_shared<const Residual>(std::move(residual));
}

/// A control step as training makes it, without and with a residual.
void HopperControlStep(benchmark::State& state, bool residual) {
  const RobotDescription robot = Load("hopper/gym.toml");
  Environment hopper(robot);
  if (residual) hopper.SetResidual(LearntResidual(robot));
  Random random(1);
  hopper.Reset(random);
  Eigen::VectorXf action(3);
  ForEachHop(state, [&](const auto& q, const auto& v, const auto& effort) {
    hopper.SetState(q, v);
    action = (effort.tail(3) / 200).template cast<float>();
    benchmark::DoNotOptimize(hopper.Step(action));
  });
}
BENCHMARK_CAPTURE(HopperControlStep, alone, false);
BENCHMARK_CAPTURE(HopperControlStep, residual, true);

// As training does it: episodes side by side, each a robot of its own. Items are control steps.
void HopperSideBySide(benchmark::State& state) {
  const auto model = std::make_shared<const Model>(Load("hopper/robot.toml"));
  std::vector<Environment> hoppers;
  std::vector<Environment::Move> moves;
  SimulatorLanes lanes(model);
  Random random(1);
  const Eigen::Vector3f action(0.1f, -0.1f, 0.1f);
  for (int i = 0; i < state.range(0); ++i) hoppers.emplace_back(model).SendThroughDriver();
  for (Environment& hopper : hoppers) {
    hopper.SetParameters(Eigen::Vector4d::NullaryExpr([&] { return random.Uniform(2.5, 5); }));
    moves.push_back({&hopper, {action.data(), 3}});
  }
  int step = 0;
  for (auto _ : state) {
    if (step++ % 100 == 0) {
      for (Environment& hopper : hoppers) hopper.Reset(random);
    }
    Environment::Step(moves, lanes);
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(HopperSideBySide)->Arg(1)->Arg(2)->Arg(4)->Arg(8);

void HopperInFlight(benchmark::State& state) {
  Simulator simulator(Load("hopper/gym.toml"));
  const Eigen::VectorXd high = (Eigen::VectorXd(6) << 0, 5, 0, -0.5, -0.5, 0).finished();
  ForEachHop(state, [&](const auto&, const auto& v, const auto& effort) {
    simulator.SetState(high, v);
    simulator.Step(effort, 0.008);
  });
}
BENCHMARK(HopperInFlight);

/// As if it did not move in a plane.
void HopperInSpace(benchmark::State& state) {
  const Model model(Load("hopper/gym.toml"));
  Topology topology = model.topology();
  topology.planar = false;
  const auto engine =
      MakeEngine(topology, model.description().simulation, model.parameters().terms());
  engine->SetPhysics(model.parameters().Nominal());
  const double h = 0.002;
  ForEachHop(state, [&](const auto& q, const auto& v, const auto& effort) {
    std::copy(q.begin(), q.end(), engine->q());
    std::copy(v.begin(), v.end(), engine->v());
    for (int i = 0; i < 4; ++i) engine->Substep(&h, effort.data(), nullptr);
  });
}
BENCHMARK(HopperInSpace);

void HopperParameters(benchmark::State& state) {
  Simulator simulator(Load("hopper/gym.toml"));
  const Eigen::VectorXd masses = Eigen::Vector4d(3.6, 4.1, 2.7, 5.3);
  const CountAllocations count(state);
  for (auto _ : state) simulator.SetParameters(masses);
}
BENCHMARK(HopperParameters);

/// Every parameter that the hopper has, geometry and inertias by Cholesky coordinates included.
void HopperAllParameters(benchmark::State& state) {
  RobotDescription robot = Load("hopper/gym.toml");
  robot.parameters.clear();
  Eigen::VectorXd values(0);
  const auto add = [&](const std::string& path, double value) {
    robot.parameters.push_back({path, "", ParameterDescription::Coordinate::kLinear, value, 1});
    values.conservativeResize(values.size() + 1);
    values.tail(1)[0] = value;
  };
  add("gravity", 9.7);
  for (const char* link : {"torso", "thigh", "leg", "foot"}) {
    const std::string of = link;
    add("mass/" + of, 3.5), add("length/" + of, 0.4);
    for (const char* axis : {"/x", "/y", "/z"}) add("com/" + of + axis, 0.1);
    for (const char* entry : {"/xx", "/yy", "/zz", "/xy", "/xz", "/yz"})
      add("inertia/" + of + entry, 0.1);
  }
  for (const char* joint : {"thigh", "leg", "foot"}) {
    for (const JointParameterKind& kind : kJointParameterKinds)
      add(std::string(kind.name) + "/" + joint, 0.01);
  }
  for (const char* path : {"contact/stiffness", "contact/damping", "contact/friction",
                           "limit/stiffness", "limit/damping"}) {
    add(path, 100);
  }
  Simulator simulator(robot);
  state.counters["parameters"] = static_cast<double>(values.size());
  const CountAllocations count(state);
  for (auto _ : state) simulator.SetParameters(values);
}
BENCHMARK(HopperAllParameters);

/// 25 simulators x 1000 transitions; items/s are control steps.
void HopperWindows(benchmark::State& state) {
  const Hops& hops = RandomHops();
  std::vector<std::vector<EffortSegment>> efforts;
  for (const Eigen::VectorXd& effort : hops.effort) efforts.push_back({{0.008, effort}});
  std::vector<Window> recorded;
  for (size_t i = 0; i < hops.size(); ++i) recorded.push_back({hops.q[i], hops.v[i], {efforts[i]}});
  Windows windows(std::make_shared<Model>(Load("hopper/gym.toml")),
                  static_cast<int>(state.range(0)));
  Eigen::MatrixXd masses(4, 25);
  Random random(1);
  for (double& mass : masses.reshaped()) mass = random.Uniform(3, 5);
  for (auto _ : state) {
    windows.Predict(masses, recorded,
                    [](Eigen::Index, size_t, size_t, const Eigen::VectorXd& q, const auto&) {
                      benchmark::DoNotOptimize(q.data());
                    });
  }
  state.SetItemsProcessed(state.iterations() * 25 * static_cast<int64_t>(hops.size()));
}
BENCHMARK(HopperWindows)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace plumb
