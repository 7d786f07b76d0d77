#include "python/native/motion.h"

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <optional>

#include "calibrator/fit/step_errors.h"
#include "calibrator/motion/csv_log.h"
#include "calibrator/motion/lcm_log.h"
#include "python/native/arrays.h"

namespace plumb::python {
namespace {

constexpr const char* kHelp =
    R"(A robot's motion as transitions: state, effort, next state. What calibrate learns from.

Made by motion (arrays), read_csv and read_lcm, for one robot. Immutable.
)";

constexpr const char* kEpisodesHelp =
    R"(The usable transitions, a dict of arrays for each episode, N rows in order of time:

q, v, next_q, next_v   states [rad or m], [rad/s or m/s]; nan = not observed
effort                 mean over the transition, shape (N, num_velocities) [Nm or N]
step, duration         number of the control step; [s]
)";

constexpr const char* kMotionHelp =
    R"(A robot's motion from arrays, a row for each control step: as a table of `plumb calibrate
--csv` (docs/commands.md).

t               shape (N,) [s]; begins anew, or goes on, with every episode
q, v            shapes (N, num_positions) [rad or m], (N, num_velocities) [rad/s or m/s]: the state
u               shape (N, actions): effort in the task's unit, Nm or N, or the effort limit in
                `hopper` and `walk`; acts from the row's time on, simulation.latency late
next_q, next_v  the state that it led to; default: the next row's state
terminated, truncated   shape (N,) of bool: true where an episode ends with this row
name            what messages and posterior.json call it
nan stands for what is not known. The same numbers give the same bits as from a file. ValueError
names the argument that is wrong; RuntimeError says why no transition can be used.
)";

using Given = std::optional<py::object>;

Eigen::MatrixXd Column(const char* name, const py::object& object, py::ssize_t columns) {
  return AsMatrix(Numbers<double>(name, object, {{kAny, columns}}, false));
}

std::vector<bool> Ends(const Given& terminated, const Given& truncated, py::ssize_t rows) {
  std::vector<bool> ends(terminated || truncated ? static_cast<size_t>(rows) : 0);
  for (const auto& [name, given] :
       {std::pair{"terminated", terminated}, {"truncated", truncated}}) {
    if (!given) continue;
    const auto flags = Numbers<bool>(name, *given, {{rows}});
    for (size_t i = 0; i < ends.size(); ++i) ends[i] = ends[i] || flags.data()[i];
  }
  return ends;
}

Motion MotionOf(std::shared_ptr<Robot> robot, const py::object& t, const py::object& q,
                const py::object& v, const py::object& u, const Given& next_q, const Given& next_v,
                const Given& terminated, const Given& truncated, const std::string& name) {
  const RobotDescription& description = robot->description();
  const py::ssize_t n = description.num_positions(), m = description.num_velocities();
  MotionColumns columns;
  columns.t = AsMatrix(Numbers<double>("t", t, {{kAny}}, false));
  columns.q = Column("q", q, n), columns.v = Column("v", v, m);
  columns.u = Column("u", u, static_cast<py::ssize_t>(description.driven().size()));
  if (next_q.has_value() != next_v.has_value())
    throw py::value_error("next_q, next_v: give both or none");
  if (next_q) columns.next_q = Column("next_q", *next_q, n);
  if (next_v) columns.next_v = Column("next_v", *next_v, m);
  columns.ends = Ends(terminated, truncated, columns.t.size());
  const py::gil_scoped_release released;
  Log log = JoinMotion(name, MakeMotionTable(columns, description), description);
  return {std::move(robot), std::move(log)};
}

template <class Get>
Array<double> Rows(const std::vector<Transition>& transitions, const Get& get) {
  Array<double> rows({std::ssize(transitions), get(transitions.front()).size()});
  Eigen::Map<Matrix<double>> to(rows.mutable_data(), rows.shape(0), rows.shape(1));
  for (size_t i = 0; i < transitions.size(); ++i)
    to.row(static_cast<Eigen::Index>(i)) = get(transitions[i]);
  return rows;
}

py::dict Episode(const Rollout& rollout) {
  py::dict episode;
  const auto add = [&](const char* name, Eigen::VectorXd Transition::*member) {
    episode[name] = Rows(
        rollout.transitions, [member](const Transition& t) -> const auto& { return t.*member; });
  };
  add("q", &Transition::q), add("v", &Transition::v);
  add("next_q", &Transition::next_q), add("next_v", &Transition::next_v);
  episode["effort"] = Rows(rollout.transitions, std::mem_fn(&Transition::mean_effort));
  std::vector<int> steps;
  std::vector<double> durations;
  for (const Transition& t : rollout.transitions)
    steps.push_back(t.step), durations.push_back(t.duration());
  episode["step"] = py::array(py::cast(steps));
  episode["duration"] = py::array(py::cast(durations));
  return episode;
}

std::string Repr(const Motion& motion) {
  return fmt::format("<Motion {}: {} transitions in {} roll-out{}>", motion.log.name,
                     CountTransitions(motion.log.rollouts), motion.log.rollouts.size(),
                     motion.log.rollouts.size() == 1 ? "" : "s");
}

using Read = Log (*)(const std::string& file, const RobotDescription& robot);

Motion ReadMotion(Read read, const std::filesystem::path& file, std::shared_ptr<Robot> robot) {
  Log log = read(file.string(), robot->description());
  return {std::move(robot), std::move(log)};
}

}  // namespace

void BindMotion(py::module_& module) {
  py::class_<Motion>(module, "Motion", kHelp)
      .def_property_readonly(
          "name", [](const Motion& m) { return m.log.name; }, "The file.")
      .def_property_readonly(
          "transitions", [](const Motion& m) { return CountTransitions(m.log.rollouts); },
          "How many can be used.")
      .def_property_readonly(
          "episodes",
          [](const Motion& m) {
            py::list episodes;
            for (const Rollout& rollout : m.log.rollouts) episodes.append(Episode(rollout));
            return episodes;
          },
          kEpisodesHelp)
      .def_property_readonly(
          "dropped", [](const Motion& m) { return m.log.drops.total(); },
          "Transitions that cannot be used.")
      .def_property_readonly(
          "warnings", [](const Motion& m) { return m.log.warnings; },
          "Parts that could not be used, in words.")
      .def("__repr__", &Repr);
  module.def("motion", &MotionOf, py::arg("robot").none(false), py::kw_only(), py::arg("t"),
             py::arg("q"), py::arg("v"), py::arg("u"), py::arg("next_q") = py::none(),
             py::arg("next_v") = py::none(), py::arg("terminated") = py::none(),
             py::arg("truncated") = py::none(), py::arg("name") = "arrays", kMotionHelp);
  module.def(
      "read_csv",
      [](const std::filesystem::path& file, std::shared_ptr<Robot> robot) {
        return ReadMotion(&ReadCsvLog, file, std::move(robot));
      },
      py::arg("file"), py::arg("robot").none(false), Unlocked(),
      "Reads a table of motion, as plumb calibrate --csv does. RuntimeError names file, line and "
      "what is wrong.");
  module.def(
      "read_lcm",
      [](const std::filesystem::path& file, std::shared_ptr<Robot> robot) {
        return ReadMotion(&ReadLcmLog, file, std::move(robot));
      },
      py::arg("file"), py::arg("robot").none(false), Unlocked(),
      "Reads the motion that an LCM log has recorded, as plumb calibrate --log does. RuntimeError "
      "names the file and what is wrong.");
}

}  // namespace plumb::python
