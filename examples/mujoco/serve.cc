// MuJoCo as somebody else's simulator, by UM-Bridge's protocol: parameters -> where MuJoCo has the
// robot at the end of each recorded step.
//
//   mujoco-serve ROBOT ROBOT.xml MOTION.csv [ADDRESS:PORT]
//
// then: plumb calibrate ROBOT --csv MOTION.csv --model http://ADDRESS:PORT

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "calibrator/motion/csv_log.h"
#include "common/listen_address.h"
#include "common/process.h"
#include "next_states.h"
#include "umbridge/server.h"

namespace {

struct Flags {
  std::string robot, xml, motion, address = "127.0.0.1:4242";
};

int Serve(plumb::Process& process, const Flags& flags) {
  const plumb::RobotDescription robot = plumb::LoadRobot(flags.robot);
  const plumb::Log log = plumb::ReadCsvLog(flags.motion, robot);
  MujocoSteps mujoco(robot, flags.xml);
  const Eigen::Index transitions = static_cast<Eigen::Index>(plumb::CountTransitions(log.rollouts)),
                     outputs = 2 * transitions * robot.num_velocities();
  const auto evaluate = [&](const Eigen::MatrixXd& parameters) {
    Eigen::MatrixXd next_states(outputs, parameters.cols());
    for (Eigen::Index j = 0; j < parameters.cols(); ++j) {
      mujoco.SetParameters(parameters.col(j));
      Eigen::Index at = 0;
      for (const plumb::Rollout& rollout : log.rollouts) {
        for (const plumb::Transition& t : rollout.transitions) {
          mujoco.SetState(t.q, t.v);
          mujoco.Step(t.efforts);
          const Eigen::VectorXd state = mujoco.State();
          next_states.col(j).segment(at, state.size()) = state;
          at += state.size();
        }
      }
    }
    return next_states;
  };
  const auto listen = plumb::ListenAddress::Parse(flags.address);
  plumb::UmbridgeServer server(
      listen, {},
      {{"next_states", static_cast<Eigen::Index>(robot.parameters.size()), outputs, evaluate}});
  std::cout << server.url() << std::endl;
  server.Run(process.stop_fd(), [&] { return process.stopping(); });
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Flags flags;
  return plumb::Run(
      "mujoco-serve", "MuJoCo as an UM-Bridge server.", argc, argv,
      [&](CLI::App& app) {
        app.add_option("robot", flags.robot, "robot folder or TOML file")->required();
        app.add_option("xml", flags.xml, "of plumb export-model --mjcf, with the prior's means")
            ->required();
        app.add_option("motion", flags.motion, "table of transitions")->required();
        app.add_option("address", flags.address, "where to listen, ADDRESS:PORT")
            ->capture_default_str();
      },
      [&](plumb::Process& process) { return Serve(process, flags); });
}
