#include <mutex>
#include <utility>

#include "python/native/arrays.h"
#include "python/native/at_work.h"
#include "python/native/distribution.h"
#include "python/native/module.h"
#include "python/native/task_batch.h"

namespace plumb::python {
namespace {

constexpr const char* kHelp =
    R"(Episodes of a task as `plumb train` sees them, in many simulations: what VectorEnv is made
of.

TaskBatch(robot, count, distribution=None, threads=0). Arrays are read-only views, which the next
call writes over.
)";

constexpr int kMostSimulations = 10'000'000;

ParameterDistribution DistributionOf(const Robot& robot, const Distribution* distribution) {
  if (!distribution) return ParameterDistribution::Prior(robot.description());
  RequireSameRobot("distribution", *distribution, robot);
  return distribution->of;
}

TaskBatch MakeTasks(const Robot& robot, ParameterDistribution distribution, int count,
                    int threads) {
  const py::gil_scoped_release released;
  return TaskBatch(robot.description(), std::move(distribution), count, threads);
}

struct Batch {
  Batch(const Robot& robot, int count, const Distribution* distribution, int threads)
      : tasks(MakeTasks(robot, DistributionOf(robot, distribution),
                        InRange("num_envs", count, 1, kMostSimulations), Threads(threads))) {}

  TaskBatch tasks;
  std::mutex mutex;
};

}  // namespace

void BindTaskBatch(py::module_& module) {
  py::class_<Batch> batch(module, "TaskBatch", kHelp);
  batch
      .def(py::init<const Robot&, int, const Distribution*, int>(), py::arg("robot"),
           py::arg("count"), py::arg("distribution") = py::none(), py::arg("threads") = 0)
      .def(
          "reset",
          [](Batch& self, uint64_t seed) {
            const AtWork at_work(self.mutex, "VectorEnv");
            self.tasks.Reset(seed);
          },
          py::arg("seed"), "Begins the first episode of that seed in all.")
      .def(
          "step",
          [](Batch& self, const py::object& actions, bool same_step) {
            const auto numbers = Numbers<float>("actions", actions,
                                                {{self.tasks.count(), self.tasks.action_size()}});
            const AtWork at_work(self.mutex, "VectorEnv");
            self.tasks.Step(numbers.data());
            if (same_step) self.tasks.BeginWhereOver();
          },
          py::arg("actions"), py::arg("same_step"),
          "One control period of all; where an episode is over the next begins, at once or with "
          "the next step.");
  const auto view = [&](const char* name, auto member, const char* help) {
    batch.def_property_readonly(
        name,
        [member](const py::object& self) {
          return View(self.cast<const Batch&>().tasks.*member, self);
        },
        help);
  };
  view("observations", &TaskBatch::observations, "Shape (count, observations), float32.");
  view("final_observations", &TaskBatch::final_observations,
       "Of the episodes that are over, shape (count, observations), float32.");
  view("rewards", &TaskBatch::rewards, "Of the step, shape (count,).");
  view("returns", &TaskBatch::returns, "Sum of the episode's rewards, shape (count,).");
  view("lengths", &TaskBatch::lengths, "Steps of the episode, shape (count,), int64.");
  view("terminated", &TaskBatch::terminated, "Ended by the task, shape (count,) of bool.");
  view("truncated", &TaskBatch::truncated, "Ended otherwise, shape (count,) of bool.");
  view("failed", &TaskBatch::failed,
       "Of these, cut off as the simulation has blown up, shape (count,) of bool.");
}

}  // namespace plumb::python
