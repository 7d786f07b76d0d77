#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <cmath>
#include <filesystem>
#include <utility>

#include "python/native/arrays.h"
#include "python/native/module.h"
#include "robot/posterior_format.h"
#include "sim/tasks/task.h"

namespace plumb::python {
namespace {

constexpr const char* kRobotHelp = R"(A robot: what robot.urdf and robot.toml say of it. Immutable.

>>> robot = plumbline.load_robot("robots/pendulum")
>>> robot
<Robot 'pendulum', task pendulum, joints: pivot>
>>> robot.period, robot.steps, robot.effort_limits
(0.05, 200, array([2.]))
>>> robot.parameters[0]
<Parameter gravity [m/s^2], 10.4 ± 0.5745>
)";

constexpr const char* kLoadHelp =
    R"(Reads a robot from its folder, or from a TOML file.

A relative path that does not exist is looked up among the robots installed with Plumbline.
RuntimeError names file, line and field of what is missing, unknown or out of range; ValueError what
cannot be simulated.
)";

std::string Repr(const ParameterDescription& parameter) {
  return fmt::format("<Parameter {} [{}], {} ± {:.4g}>", parameter.name, parameter.unit,
                     parameter.mean, std::sqrt(parameter.variance));
}

template <class Items>
std::vector<std::string> NamesOf(const Items& items) {
  std::vector<std::string> names;
  names.reserve(items.size());
  for (const auto& item : items) names.push_back(item.name);
  return names;
}

std::string Repr(const Robot& robot) {
  const RobotDescription& description = robot.description();
  return fmt::format("<Robot '{}', task {}, joints: {}>", description.name, description.task.name,
                     fmt::join(NamesOf(description.joints), ", "));
}

void BindParameter(py::module_& module) {
  using Parameter = ParameterDescription;
  py::class_<Parameter>(module, "Parameter", "An uncertain parameter of a robot's simulators.")
      .def_readonly("name", &Parameter::name, R"(Its path, such as "mass/pole".)")
      .def_readonly("unit", &Parameter::unit, "Its physical unit.")
      .def_readonly("mean", &Parameter::mean, "Of the prior, physical units.")
      .def_property_readonly(
          "sd", [](const Parameter& p) { return std::sqrt(p.variance); },
          "Standard deviation of the prior, physical units.")
      .def_property_readonly(
          "coordinate", [](const Parameter& p) { return CoordinateName(p.coordinate); },
          R"(In which it is normal: "linear", "log" or "logit".)")
      .def_readonly("lower", &Parameter::lower, "Bound of a logit's, physical units; else -inf.")
      .def_readonly("upper", &Parameter::upper, "Bound of a logit's, physical units; else inf.")
      .def("__repr__", [](const Parameter& p) { return Repr(p); });
}

}  // namespace

void BindRobot(py::module_& module) {
  BindParameter(module);
  py::class_<Robot, std::shared_ptr<Robot>> robot(module, "Robot", kRobotHelp);
  const auto property = [&](const char* name, auto get, const char* help) {
    robot.def_property_readonly(
        name, [get](const Robot& self) { return get(self.description()); }, help);
  };
  using Description = RobotDescription;
  property(
      "name", [](const Description& d) { return d.name; }, "Its name.");
  property(
      "file", [](const Description& d) { return d.file; }, "The TOML file.");
  property(
      "task", [](const Description& d) { return d.task.name; }, "Name of its task.");
  property(
      "period", [](const Description& d) { return d.task.period; }, "Control period [s].");
  property(
      "steps", [](const Description& d) { return d.task.steps; },
      "Time limit of an episode, in control steps.");
  property(
      "links", [](const Description& d) { return NamesOf(d.links); },
      "Names of the links, the fixed base first.");
  property(
      "joints", [](const Description& d) { return NamesOf(d.joints); },
      "Names of the joints, in the order of q and v.");
  property(
      "actions", [](const Description& d) { return MakeTask(d)->action_names(); },
      "Names of the driven joints, in the order of actions.");
  property(
      "observations", [](const Description& d) { return MakeTask(d)->observation_names(); },
      "Names of what a policy sees, with units.");
  property(
      "effort_limits", [](const Description& d) { return ToArray(d.effort_limits()); },
      "Effort of an action of 1, shape (actions,) [Nm or N].");
  property(
      "num_positions", [](const Description& d) { return d.num_positions(); }, "Size of q.");
  property(
      "num_velocities", [](const Description& d) { return d.num_velocities(); }, "Size of v.");
  property(
      "parameters", [](const Description& d) { return d.parameters; },
      "The uncertain parameters, with their priors.");
  property(
      "warnings", [](const Description& d) { return d.warnings; },
      "Parts of the files that have no effect.");
  robot.def("__repr__", [](const Robot& self) { return Repr(self); });
  module.def(
      "load_robot",
      [](const std::filesystem::path& path) { return std::make_shared<Robot>(path.string()); },
      py::arg("path"), Unlocked(), kLoadHelp);
}

}  // namespace plumb::python
