#include "calibrator/results/calibration.h"

#include <fmt/format.h>
#include <pybind11/functional.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <limits>
#include <optional>

#include "calibrator/results/posterior_file.h"
#include "calibrator/results/summary.h"
#include "common/thread_count.h"
#include "python/native/arrays.h"
#include "python/native/distribution.h"
#include "python/native/motion.h"

namespace plumb::python {
namespace {

constexpr const char* kHelp =
    R"(What calibrate has found. Arrays are in the order of `names`, physical units. Immutable.)";

constexpr const char* kCalibrateHelp =
    R"(Learns from motions which simulators could have produced them, as `plumb calibrate` does,
with the same bits.

motions   a Motion, or a list of them: each is a log of its own, and they are compared
method, seed, horizons, budget, discrepancy, residual   as the command's flags
threads   0 = one per core; the result does not depend on it
progress  is called as progress(what, share), share from 0 to 1, from this thread; what it raises
          ends the calibration
Ctrl-C ends it, too. Other Python threads run meanwhile. ValueError for an unknown method or
discrepancy, or motions that cannot be used.
)";

constexpr int kMostHorizon = 1000;
constexpr int64_t kLeastBudget = 100, kMostBudget = 1'000'000'000'000;

struct Calibration {
  std::shared_ptr<const Robot> robot;
  Findings findings;
  Provenance provenance;
  Summary summary;

  std::string Json() const { return PosteriorJson(findings, robot->description(), provenance); }
};

/// Of the words that the command prints, those that are there.
std::vector<std::string> Words(const Findings& findings) {
  std::vector<std::string> words{findings.identifiability.summary,
                                 findings.advice,
                                 findings.misspecification.summary,
                                 findings.gap.summary,
                                 findings.holdout.summary,
                                 findings.agreement.summary,
                                 findings.check};
  std::erase(words, "");
  return words;
}

std::vector<Log> LogsOf(const py::object& motions, const RobotDescription& robot) {
  std::vector<const Motion*> given;
  if (py::isinstance<Motion>(motions)) {
    given.push_back(motions.cast<const Motion*>());
  } else if (py::isinstance<py::sequence>(motions)) {
    for (const py::handle motion : motions) {
      if (!py::isinstance<Motion>(motion))
        throw py::value_error("motions: has something else than a Motion");
      given.push_back(motion.cast<const Motion*>());
    }
  } else {
    throw py::value_error("motions: is neither a Motion nor a list of them");
  }
  if (given.empty()) throw py::value_error("motions: there is nothing to calibrate with");
  std::vector<Log> logs;
  for (const Motion* motion : given) {
    const RobotDescription& its = motion->robot->description();
    if (its.fingerprint != robot.fingerprint) {
      throw py::value_error(fmt::format("motions: {} is of another robot, {}, not {}",
                                        motion->log.name, its.file, robot.file));
    }
    logs.push_back(motion->log);
  }
  return logs;
}

Calibration Run(std::shared_ptr<Robot> robot, const py::object& motions, const std::string& method,
                uint64_t seed, const std::vector<int>& horizons, int64_t budget,
                const std::string& discrepancy, bool residual, int threads,
                const std::optional<py::function>& progress) {
  const RobotDescription& description = robot->description();
  const std::vector<Log> logs = LogsOf(motions, description);
  CalibrationOptions options;
  options.method = method, options.seed = seed, options.discrepancy = discrepancy;
  if (horizons.empty()) throw py::value_error("horizons: is empty");
  for (const int horizon : horizons) InRange("horizons", horizon, 1, kMostHorizon);
  options.horizons = horizons;
  options.budget = InRange("budget", budget, kLeastBudget, kMostBudget);
  options.residual = residual && description.calibration.residual;
  options.execution.threads = ThreadCount(Threads(threads));
  options.progress = [&](const std::string& what, double share) {
    const py::gil_scoped_acquire acquired;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (progress) (*progress)(what, share);
  };
  const py::gil_scoped_release released;
  Findings findings = Calibrate(description, logs, options);
  Summary summary = Summarise(findings, description);
  return {std::move(robot), std::move(findings),
          ProvenanceOf(logs, options, "plumbline.calibrate", std::time(nullptr)),
          std::move(summary)};
}

std::string Repr(const Calibration& self) {
  std::string text = "<Calibration";
  const auto& parameters = self.robot->description().parameters;
  for (size_t i = 0; i < parameters.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    text += fmt::format("{} {} {:.4g} ± {:.2g}", i > 0 ? "," : "", parameters[i].name,
                        self.summary.mean(at), self.summary.sd(at));
  }
  return text + ">";
}

void BindNumbers(py::class_<Calibration>& calibration) {
  const auto numbers = [&](const char* name, auto get, const char* help) {
    calibration.def_property_readonly(
        name, [get](const Calibration& self) { return ToArray(get(self.summary)); }, help);
  };
  numbers(
      "mean", [](const Summary& s) { return s.mean; }, "Of the samples, shape (parameters,).");
  numbers(
      "sd", [](const Summary& s) { return s.sd; },
      "Standard deviations of the samples, shape (parameters,).");
  numbers(
      "lower", [](const Summary& s) { return s.lower; },
      "2.5 % quantiles of the samples, shape (parameters,).");
  numbers(
      "upper", [](const Summary& s) { return s.upper; },
      "97.5 % quantiles of the samples, shape (parameters,).");
  numbers(
      "covariance", [](const Summary& s) { return s.covariance; },
      "Of the samples, shape (parameters, parameters).");
  numbers(
      "samples", [](const Summary& s) { return Eigen::MatrixXd(s.samples.transpose()); },
      "Of the posterior, equally weighted, shape (N, parameters).");
}

void BindFindings(py::class_<Calibration>& calibration) {
  const auto finding = [&](const char* name, auto get, const char* help) {
    calibration.def_property_readonly(
        name, [get](const Calibration& self) { return get(self.findings); }, help);
  };
  finding(
      "method", [](const Findings& f) { return f.used; }, "That gave the answer.");
  finding(
      "transitions", [](const Findings& f) { return f.transitions; }, "Learnt from.");
  finding(
      "discrepancy", [](const Findings& f) { return f.discrepancy; },
      "Mean squared one-step error in units of its uncertainty; 1 = down to the noise; NaN where "
      "nobody knows the noise.");
  finding(
      "alarm", [](const Findings& f) { return f.misspecification.alarm; },
      "Whether the model cannot explain the robot.");
  finding(
      "trustworthy", [](const Findings& f) { return Trustworthy(f); },
      "What plumb calibrate --strict asks for: better than the prior on motion not seen, no "
      "alarm, the motions agree, efforts stand in their rows, and the prior is not contradicted.");
  finding("findings", &Words, "In words, those that the command prints.");
  finding(
      "warnings", [](const Findings& f) { return f.warnings; }, "In words.");
}

}  // namespace

void BindCalibration(py::module_& module) {
  py::class_<Calibration> calibration(module, "Calibration", kHelp);
  BindNumbers(calibration);
  BindFindings(calibration);
  calibration
      .def_property_readonly(
          "names",
          [](const Calibration& self) {
            std::vector<std::string> names;
            for (const auto& p : self.robot->description().parameters) names.push_back(p.name);
            return names;
          },
          "Of the parameters.")
      .def_property_readonly(
          "distribution",
          [](const Calibration& self) {
            const Findings& found = self.findings;
            return Distribution{self.robot,
                                {.iteration = 1,
                                 .parameters = self.robot->description().parameters,
                                 .mixture = found.posterior,
                                 .residual = found.gap.residual,
                                 .starts = found.starts}};
          },
          "The posterior, with what its simulators lack: what load_posterior makes of the file.")
      .def("json", &Calibration::Json, "The text of posterior.json (docs/posterior.md).")
      .def(
          "save",
          [](const Calibration& self, const std::filesystem::path& file) {
            WritePosterior(file, self.findings, self.robot->description(), self.provenance);
          },
          py::arg("file"), Unlocked(),
          "Writes posterior.json, atomically: all of it but its last object, run, is the same to "
          "the byte as the command's.")
      .def("__repr__", &Repr);
  module.def("calibrate", &Run, py::arg("robot").none(false), py::arg("motions"),
             py::arg("method") = "auto", py::arg("seed") = 1,
             py::arg("horizons") = std::vector{1, 5, 10, 50}, py::arg("budget") = 100'000,
             py::arg("discrepancy") = "likelihood", py::arg("residual") = true,
             py::arg("threads") = 0, py::arg("progress") = py::none(), kCalibrateHelp);
}

}  // namespace plumb::python
