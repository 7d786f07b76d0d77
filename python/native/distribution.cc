#include "python/native/distribution.h"

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <filesystem>

#include "python/native/arrays.h"
#include "robot/physics_fingerprint.h"
#include "sim/simulators.h"

namespace plumb::python {
namespace {

constexpr const char* kHelp =
    R"(Which simulators a robot may be: a mixture of Gaussians over the parameters' coordinates.

Coordinates are those in which a parameter is normal (Parameter.coordinate); all else is in
physical units. Made by prior, load_posterior and Calibration.distribution. Immutable.

>>> prior = plumbline.prior(plumbline.load_robot("robots/pendulum"))
>>> prior.names
['gravity', 'mass/pole', 'length/pole']
>>> prior.sample(3, seed=1).shape
(3, 3)
)";

constexpr const char* kSampleHelp =
    R"(Draws parameters of the mixture: shape (count, parameters), physical units.

Row i depends on the seed and on i alone. A linear parameter's row may be one of which there is no
simulator, a negative mass: set_parameters says so.
)";

constexpr uint32_t kSampleStream = 0x53414d50;  // "SAMP", second word of the random streams
constexpr int kMostSamples = 100'000'000;

Eigen::MatrixXd Rows(const std::vector<Gaussian>& components, py::ssize_t size) {
  Eigen::MatrixXd rows(components.size(), size);
  for (size_t i = 0; i < components.size(); ++i)
    rows.row(static_cast<Eigen::Index>(i)) = components[i].mean;
  return rows;
}

Array<double> Covariances(const ParameterDistribution& distribution) {
  const auto n = static_cast<py::ssize_t>(distribution.size());
  const auto& components = distribution.mixture.components;
  Array<double> all({static_cast<py::ssize_t>(components.size()), n, n});
  for (size_t i = 0; i < components.size(); ++i) {
    Eigen::Map<Matrix<double>>(all.mutable_data(static_cast<py::ssize_t>(i), 0, 0), n, n) =
        components[i].covariance;
  }
  return all;
}

Array<double> Sample(const Distribution& self, int count, uint64_t seed) {
  InRange("count", count, 0, kMostSamples);
  Array<double> samples(
      {static_cast<py::ssize_t>(count), static_cast<py::ssize_t>(self.of.size())});
  Eigen::Map<Matrix<double>> rows(samples.mutable_data(), count, self.of.size());
  const py::gil_scoped_release released;
  for (int i = 0; i < count; ++i) {
    Random random(seed, {static_cast<uint32_t>(i), kSampleStream});
    rows.row(i) = self.of.Sample(random);
  }
  return samples;
}

std::vector<std::string> Names(const Distribution& self) {
  std::vector<std::string> names;
  for (const ParameterDescription& p : self.of.parameters) names.push_back(p.name);
  return names;
}

}  // namespace

void RequireSameRobot(const char* name, const Distribution& distribution, const Robot& robot) {
  const RobotDescription &its = distribution.robot->description(), &other = robot.description();
  const bool same =
      PhysicsFingerprint(its) == PhysicsFingerprint(other) &&
      std::equal(its.parameters.begin(), its.parameters.end(), other.parameters.begin(),
                 other.parameters.end(), [](const auto& a, const auto& b) {
                   return a.name == b.name && a.coordinate == b.coordinate && a.lower == b.lower &&
                          a.upper == b.upper;
                 });
  if (!same) {
    throw py::value_error(fmt::format("{}: is of robot '{}' as {} has it, not of {}", name,
                                      its.name, its.file, other.file));
  }
}

void BindDistribution(py::module_& module) {
  py::class_<Distribution>(module, "Distribution", kHelp)
      .def_property_readonly("names", &Names, "Of the parameters.")
      .def_property_readonly(
          "weights",
          [](const Distribution& d) { return py::array(py::cast(d.of.mixture.weights)); },
          "Of the components, shape (components,); they sum to 1.")
      .def_property_readonly(
          "means",
          [](const Distribution& d) { return ToArray(Rows(d.of.mixture.components, d.of.size())); },
          "Of the components, shape (components, parameters), coordinates.")
      .def_property_readonly(
          "covariances", [](const Distribution& d) { return Covariances(d.of); },
          "Of the components, shape (components, parameters, parameters), coordinates.")
      .def_property_readonly(
          "mean", [](const Distribution& d) { return ToArray(d.of.Mean()); },
          "Of the mixture, shape (parameters,), physical units.")
      .def_property_readonly(
          "sd", [](const Distribution& d) { return ToArray(d.of.Sd()); },
          "Standard deviations of the mixture, shape (parameters,), physical units.")
      .def_property_readonly(
          "has_residual", [](const Distribution& d) { return d.of.residual != nullptr; },
          "Whether it knows of something that its simulators lack.")
      .def("sample", &Sample, py::arg("count"), py::arg("seed"), kSampleHelp);
  module.def(
      "prior",
      [](std::shared_ptr<Robot> robot) {
        auto of = ParameterDistribution::Prior(robot->description());
        return Distribution{std::move(robot), std::move(of)};
      },
      py::arg("robot").none(false), "The robot's prior.");
  module.def(
      "load_posterior",
      [](const std::filesystem::path& file, std::shared_ptr<Robot> robot) {
        auto of = ReadSimulators(file, robot->description());
        return Distribution{std::move(robot), std::move(of)};
      },
      py::arg("file"), py::arg("robot").none(false), Unlocked(),
      "Reads a posterior.json that plumb calibrate, Calibration.save or a run has written, with "
      "what it says that these simulators lack. RuntimeError names the file and the field that is "
      "wrong, or another robot's.");
}

}  // namespace plumb::python
