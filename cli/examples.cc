#include "cli/examples.h"

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "common/examples.h"

namespace plumb {
namespace {

const struct {
  std::vector<std::string> path;  // of commands below plumb
  std::vector<std::string> examples;
} kExamples[] = {
    {{"launch"},
     {"plumb launch robots/pendulum --seed 1",
      "plumb launch robots/hopper --iterations 2 --log hop.lcmlog --dashboard",
      "plumb launch robots/mine --real --bus socketcan:can0 --key robot.key"}},
    {{"sim"},
     {"plumb sim robots/pendulum --policy policy.onnx --gif swing_up.gif",
      "plumb sim robots/hopper --random --episodes 20 --noise 0.003 --csv hop.csv"}},
    {{"calibrate"},
     {"plumb calibrate robots/hopper --log hop.lcmlog --report report.html",
      "plumb calibrate robots/hopper --csv hop.csv --output posterior.json --strict",
      "plumb calibrate robots/hopper --csv hop.csv --model http://127.0.0.1:4242"}},
    {{"excite"}, {"plumb excite robots/double_pendulum --seconds 4 --output excitation.csv"}},
    {{"train"},
     {"plumb train robots/pendulum --output policy.onnx",
      "plumb train robots/hopper --distribution posterior.json --steps 1e6 --report "
      "training.html"}},
    {{"export-model"},
     {"plumb export-model robots/hopper --posterior posterior.json --mjcf hopper.xml",
      "plumb export-model robots/hopper --randomisation table.json --samples 1000 --seed 2"}},
    {{"serve-model"},
     {"plumb serve-model robots/hopper --csv hop.csv",
      "plumb serve-model robots/hopper --log hop.lcmlog --address 0.0.0.0:4243 --host robot.lab"}},
    {{"doctor"}, {"plumb doctor --bus socketcan:can0 --key robot.key"}},
    {{"can"}, {"plumb can plan robots/hopper"}},
    {{"can", "plan"}, {"plumb can plan robots/hopper"}},
    {{"can", "dbc"}, {"plumb can dbc robots/hopper --output hopper.dbc"}},
    {{"estimate"}, {"plumb estimate tune robots/hopper --log hop.lcmlog"}},
    {{"estimate", "tune"}, {"plumb estimate tune robots/hopper --log hop.lcmlog"}},
    {{"arm"}, {"plumb arm --key robot.key", "plumb arm --homed"}},
    {{"disarm"}, {"plumb disarm"}},
    {{"estop"}, {"plumb estop"}},
    {{"record"}, {"plumb record run.lcmlog --robot robots/hopper --note \"after the new gear\""}},
    {{"replay"},
     {"plumb replay run.lcmlog --from 12 --speed 0.25", "plumb replay run.lcmlog --speed 0"}},
    {{"export"},
     {"plumb export run.lcmlog --mcap run.mcap", "plumb export run.lcmlog --csv tables"}},
    {{"meldis"}, {"plumb meldis robots/hopper"}},
    {{"key"}, {"plumb key robot.key"}},
};

}  // namespace

void AddCommandExamples(CLI::App& plumb) {
  AddExamples(plumb, {"plumb launch robots/pendulum", "plumb calibrate --help"});
  for (const auto& [path, examples] : kExamples) {
    CLI::App* command = &plumb;
    for (const std::string& name : path) command = command->get_subcommand(name);
    AddExamples(*command, examples);
  }
}

}  // namespace plumb
