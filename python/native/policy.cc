#include "python/native/policy.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <stdexcept>
#include <vector>

#include "common/ranks.h"
#include "python/native/arrays.h"
#include "python/native/distribution.h"
#include "python/native/interruption.h"
#include "sim/tasks/task.h"
#include "trainer/policy_file.h"
#include "trainer/robot_simulation.h"
#include "trainer/rollout.h"
#include "trainer/streams.h"

namespace plumb::python {
namespace {

constexpr const char* kHelp =
    R"(A policy that `plumb train` or a run has trained: a Gaussian around a network's mean action.

Made by load_policy. Called with observations, shape (count, observations) or (observations,), as
the task gives them, it returns the mean actions, shape (count, actions) or (actions,), float32 in
policy units: 1 is the joint's effort limit, and what lies beyond [-1, 1] is clipped where it
becomes an effort. The same bits as in `plumb sim --policy`. Immutable.
)";

constexpr const char* kSampleHelp =
    R"(Draws actions around the mean ones; the shapes are those of a call. Row i depends on the
seed and on i alone.)";

constexpr const char* kEvaluateHelp =
    R"(Returns of episodes without exploration in simulators drawn one for each, by all cores:
shape (episodes,).

distribution  of the simulators; default: the robot's prior
threads       0 = as many as the machine has cores; the result does not depend on it
nan stands for an episode that was not finite, or had parameters of which there is no simulator.
The simulators are those on which `plumb train --seed` has evaluated the policy after training: the
same returns. Ctrl-C ends it. Other Python threads run meanwhile.
)";

constexpr uint32_t kActionStream = 0x41435450;  // "ACTP", second word of the random streams
constexpr int kMostEpisodes = 100'000'000;

using Choose = Eigen::VectorXf (*)(const GaussianPolicy&, const Eigen::Ref<const Eigen::VectorXf>&,
                                   uint64_t seed, uint32_t row);

Array<float> Act(const Policy& self, const py::object& observations, uint64_t seed, Choose choose) {
  const py::ssize_t in = self.gaussian.shape().observations, out = self.gaussian.shape().actions;
  const auto given = Numbers<float>("observations", observations, {{kAny, in}, {in}});
  const bool single = given.ndim() == 1;
  const py::ssize_t rows = single ? 1 : given.shape(0);
  Array<float> actions(single ? std::vector{out} : std::vector{rows, out});
  const float* from = given.data();
  Eigen::Map<Matrix<float>> to(actions.mutable_data(), rows, out);
  const py::gil_scoped_release released;
  for (py::ssize_t i = 0; i < rows; ++i) {
    to.row(i) = choose(self.gaussian, Eigen::Map<const Eigen::VectorXf>(from + i * in, in), seed,
                       static_cast<uint32_t>(i));
  }
  return actions;
}

Array<double> Evaluate(const Policy& self, const Distribution* distribution, int episodes,
                       uint64_t seed, int threads) {
  InRange("episodes", episodes, 0, kMostEpisodes), Threads(threads);
  if (distribution) RequireSameRobot("distribution", *distribution, *self.robot);
  std::vector<double> returns;
  Interruption interruption;
  {
    const py::gil_scoped_release released;
    const RobotDescription& robot = self.robot->description();
    const ParameterDistribution of =
        distribution ? distribution->of : ParameterDistribution::Prior(robot);
    Workers workers(threads);
    RolloutSampler sampler(SimulateRobot(robot), self.gaussian.shape(), workers, Ranks::Alone());
    const ParameterSampler draw = [&](Random& random) {
      // An episode without a simulator is not played.
      if (interruption.came()) throw std::invalid_argument("interrupted");
      return of.Draw(random);
    };
    returns = sampler.Returns(self.gaussian, draw, episodes, seed, kHeldOutStream, 0);
  }
  interruption.Raise();
  return Array<double>(static_cast<py::ssize_t>(returns.size()), returns.data());
}

}  // namespace

void BindPolicy(py::module_& module) {
  py::class_<Policy>(module, "Policy", kHelp)
      .def(
          "__call__",
          [](const Policy& self, const py::object& observations) {
            return Act(self, observations, 0,
                       [](const GaussianPolicy& policy, const auto& observation, uint64_t,
                          uint32_t) { return policy.Mean(observation); });
          },
          py::arg("observations"), "The mean actions: see Policy.")
      .def(
          "sample",
          [](const Policy& self, const py::object& observations, uint64_t seed) {
            return Act(self, observations, seed,
                       [](const GaussianPolicy& policy, const auto& observation, uint64_t from,
                          uint32_t row) {
                         Random random(from, {row, kActionStream});
                         return policy.Sample(observation, random);
                       });
          },
          py::arg("observations"), py::arg("seed"), kSampleHelp)
      .def("evaluate", &Evaluate, py::arg("distribution") = py::none(), py::arg("episodes") = 100,
           py::arg("seed") = 1, py::arg("threads") = 0, kEvaluateHelp)
      .def_property_readonly(
          "hidden", [](const Policy& self) { return self.gaussian.shape().hidden; },
          "Sizes of the hidden layers.")
      .def_property_readonly(
          "sd",
          [](const Policy& self) {
            return ToArray(Eigen::VectorXd(self.gaussian.log_std().array().exp().cast<double>()));
          },
          "Standard deviation of sampled actions, shape (actions,), policy units.");
  module.def(
      "load_policy",
      [](const std::filesystem::path& file, std::shared_ptr<Robot> robot) {
        const auto task = MakeTask(robot->description());
        auto gaussian = LoadPolicy(file.string(), robot->description(), *task);
        return Policy{std::move(robot), std::move(gaussian)};
      },
      py::arg("file"), py::arg("robot").none(false), Unlocked(),
      "Reads a policy from an ONNX model that Plumbline has written, or from a trainer's "
      "checkpoint: of several the one that the robot is to be run with. ValueError or RuntimeError "
      "names the file if it is none, damaged, or of another robot or task.");
}

}  // namespace plumb::python
