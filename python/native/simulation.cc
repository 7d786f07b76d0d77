#include <fmt/format.h>
#include <pybind11/stl.h>

#include <limits>
#include <memory>
#include <mutex>
#include <numeric>
#include <optional>

#include "python/native/arrays.h"
#include "python/native/at_work.h"
#include "python/native/environment_batch.h"
#include "python/native/module.h"

namespace plumb::python {
namespace {

constexpr const char* kHelp = R"(A robot's task, simulated many times side by side by all cores.

Simulation(robot, count, threads=0): `count` environments in the zero state, with the prior's means
as parameters; `threads` 0 takes as many as the machine has cores. Each environment has the same
bits as alone, and as in `plumb sim`, for any number of threads. While one works other Python
threads run; of one Simulation one thread may make use at a time.

`observations`, `q`, `v`, `rewards` and `terminated` are read-only views of its own memory: no copy
is made, and the next call writes over them. Keep them with .copy().

>>> simulation = plumbline.Simulation(plumbline.load_robot("robots/pendulum"), count=1000)
>>> observations = simulation.reset(seed=1)
>>> observations.shape, observations.dtype
((1000, 3), dtype('float32'))
>>> observations, rewards, terminated = simulation.step(numpy.zeros((1000, 1), "float32"))
>>> rewards.shape, terminated.any()
((1000,), False)
)";

constexpr const char* kResetHelp =
    R"(Begins episodes: draws states of the task's initial distribution.

seed      of all random numbers
numbers   of the episodes, shape (count,); default 0, 1, 2, ...: equal seeds and numbers begin
          equally, as episode `number` of `plumb sim --seed` does
where     shape (count,) of bool: those that begin; default all
Returns observations, shape (count, observations), float32.
)";

constexpr const char* kStepHelp = R"(One control period of all environments.

actions   shape (count, actions), policy units: 1 is the joint's effort limit, what lies beyond
          [-1, 1] is clipped. float32 in C order is read where it is, everything else is converted
Returns (observations, rewards, terminated): shape (count, observations) float32, (count,) float64,
(count,) bool. terminated says that the task is over, or that the simulation has blown up: its
reward is nan then. The time limit, robot.steps, is the caller's to count, and episodes begin anew
with reset alone.
)";

constexpr int kMostEnvironments = 10'000'000;
constexpr uint32_t kMostNumber = std::numeric_limits<uint32_t>::max();

std::shared_ptr<EnvironmentBatch> MakeBatch(const Robot& robot, int count, int threads) {
  const py::gil_scoped_release released;
  return std::make_shared<EnvironmentBatch>(robot.model, count, threads);
}

class Simulation {
 public:
  Simulation(const Robot& robot, int count, int threads)
      : batch_(MakeBatch(robot, InRange("count", count, 1, kMostEnvironments), Threads(threads))) {
    // What it has lent outlives it.
    const py::capsule owner(new std::shared_ptr<EnvironmentBatch>(batch_), [](void* batch) {
      delete static_cast<std::shared_ptr<EnvironmentBatch>*>(batch);
    });
    observations_ = View(batch_->observations(), owner);
    q_ = View(batch_->q(), owner), v_ = View(batch_->v(), owner);
    rewards_ = View(batch_->rewards(), owner);
    terminated_ = View(batch_->terminated(), owner);
    of_a_step_ = py::make_tuple(observations_, rewards_, terminated_);
  }

  int count() const { return batch_->count(); }
  int threads() const { return batch_->threads(); }
  const py::array& observations() const { return observations_; }
  const py::array& q() const { return q_; }
  const py::array& v() const { return v_; }
  const py::array& rewards() const { return rewards_; }
  const py::array& terminated() const { return terminated_; }

  void SetParameters(const py::object& parameters) {
    const py::ssize_t size = batch_->model().parameters().size();
    const auto numbers = Numbers<double>("parameters", parameters, {{size}, {count(), size}});
    const AtWork at_work(mutex_, "Simulation");
    if (numbers.ndim() == 2) {
      batch_->SetParameters(AsMatrix(numbers));
    } else {
      batch_->SetParameters(
          Eigen::Map<const Eigen::RowVectorXd>(numbers.data(), size).replicate(count(), 1));
    }
  }

  const py::array& Reset(uint64_t seed, const py::object& numbers, const py::object& where) {
    const std::vector<uint32_t> episodes = EpisodeNumbers(numbers);
    std::optional<Array<bool>> mask;
    if (!where.is_none()) mask = Numbers<bool>("where", where, {{count()}});
    std::span<const bool> begins;
    if (mask) begins = {mask->data(), static_cast<size_t>(count())};
    const AtWork at_work(mutex_, "Simulation");
    batch_->Reset(seed, episodes, begins);
    return observations_;
  }

  void SetState(const py::object& q, const py::object& v) {
    const auto positions = Numbers<double>("q", q, {{count(), batch_->q().cols()}});
    const auto velocities = Numbers<double>("v", v, {{count(), batch_->v().cols()}});
    const AtWork at_work(mutex_, "Simulation");
    batch_->SetState(AsMatrix(positions), AsMatrix(velocities));
  }

  const py::tuple& Step(const py::object& actions) {
    const auto numbers = Numbers<float>("actions", actions, {{count(), batch_->action_size()}});
    const AtWork at_work(mutex_, "Simulation");
    batch_->Step(numbers.data());
    return of_a_step_;
  }

 private:
  std::vector<uint32_t> EpisodeNumbers(const py::object& numbers) const {
    std::vector<uint32_t> episodes(static_cast<size_t>(count()));
    if (numbers.is_none()) {
      std::iota(episodes.begin(), episodes.end(), 0);
      return episodes;
    }
    const auto given = Numbers<double>("numbers", numbers, {{count()}});
    for (size_t i = 0; i < episodes.size(); ++i) {
      const double number = given.data()[i];
      if (number != std::floor(number) || number < 0 || number > kMostNumber)
        throw py::value_error(fmt::format("numbers: {} is no number of an episode", number));
      episodes[i] = static_cast<uint32_t>(number);
    }
    return episodes;
  }

  std::shared_ptr<EnvironmentBatch> batch_;
  std::mutex mutex_;
  // Made once: to make them costs as much as a small batch's step.
  py::array observations_, q_, v_, rewards_, terminated_;
  py::tuple of_a_step_;
};

}  // namespace

void BindSimulation(py::module_& module) {
  py::class_<Simulation> simulation(module, "Simulation", kHelp);
  simulation
      .def(py::init<const Robot&, int, int>(), py::arg("robot"), py::arg("count"),
           py::arg("threads") = 0)
      .def_property_readonly("count", &Simulation::count, "How many environments.")
      .def_property_readonly("threads", &Simulation::threads, "How many threads.")
      .def("set_parameters", &Simulation::SetParameters, py::arg("parameters"),
           "Gives all the same parameters, shape (parameters,), or each its own, shape (count, "
           "parameters); physical units, in the order of robot.parameters. ValueError for what is "
           "not physical.")
      .def("reset", &Simulation::Reset, py::arg("seed"), py::arg("numbers") = py::none(),
           py::arg("where") = py::none(), kResetHelp)
      .def("set_state", &Simulation::SetState, py::arg("q"), py::arg("v"),
           "Puts all into states: q, shape (count, num_positions) [rad or m], and v, shape (count, "
           "num_velocities) [rad/s or m/s]. No effort has been applied yet.")
      .def("step", &Simulation::Step, py::arg("actions"), kStepHelp)
      .def_property_readonly("observations", &Simulation::observations,
                             "Shape (count, observations), float32.")
      .def_property_readonly("q", &Simulation::q,
                             "Positions, shape (count, num_positions) [rad or m].")
      .def_property_readonly("v", &Simulation::v,
                             "Velocities, shape (count, num_velocities) [rad/s or m/s].")
      .def_property_readonly("rewards", &Simulation::rewards, "Of the latest step, shape (count,).")
      .def_property_readonly("terminated", &Simulation::terminated,
                             "Of the latest step, shape (count,) of bool.");
}

}  // namespace plumb::python
