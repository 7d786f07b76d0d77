#pragma once

#include <pybind11/pybind11.h>

#include <memory>

#include "robot/description.h"
#include "sim/model.h"

// The module plumbline._native: a thin layer over the rooms, one file for each subject.
namespace plumb::python {

/// A robot, and the model that all its simulators share. Immutable, hence thread-safe.
struct Robot {
  explicit Robot(const std::string& folder_or_file)
      : model(std::make_shared<Model>(LoadRobot(folder_or_file))) {}
  const RobotDescription& description() const { return model->description(); }

  std::shared_ptr<const Model> model;
};

/// Of functions that read or write a file: other Python threads run meanwhile.
using Unlocked = pybind11::call_guard<pybind11::gil_scoped_release>;

void BindRobot(pybind11::module_& module);
void BindSimulation(pybind11::module_& module);
void BindPlay(pybind11::module_& module);
void BindDistribution(pybind11::module_& module);
void BindPolicy(pybind11::module_& module);
void BindTaskBatch(pybind11::module_& module);
void BindMotion(pybind11::module_& module);
void BindCalibration(pybind11::module_& module);

}  // namespace plumb::python
