#include "python/native/module.h"

#include "common/program_version.h"

PYBIND11_MODULE(_native, module) {
  using namespace plumb::python;
  module.doc() = "Plumbline's simulator, calibration and policies: see the package plumbline.";
  module.attr("__version__") = plumb::ProgramVersion();
  BindRobot(module);
  BindSimulation(module);
  BindPlay(module);
  BindDistribution(module);
  BindPolicy(module);
  BindTaskBatch(module);
  BindMotion(module);
  BindCalibration(module);
}
