// The motion of a robot that lives in MuJoCo: begins as each roll-out of a table does, with the
// same efforts, and writes what MuJoCo makes of them as another table, with noise on every reading.
//
//   mujoco-record ROBOT ROBOT.xml EFFORTS.csv MOTION.csv VALUE ...
//
// VALUEs are the robot's uncertain parameters, in the order of robot.toml.

#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <fstream>

#include "calibrator/motion/csv_log.h"
#include "common/random.h"
#include "next_states.h"
#include "sim/tasks/task.h"

namespace {

constexpr double kNoise = 0.003;  // [rad or m, rad/s or m/s] standard deviation

std::string Header(const plumb::RobotDescription& robot) {
  std::string q, v, u;
  for (const plumb::JointDescription& joint : robot.joints) {
    q += ",q/" + joint.name, v += ",v/" + joint.name;
    if (!joint.passive) u += ",u/" + joint.name;
  }
  return "t" + q + v + u + "\n";
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 5) throw std::runtime_error("usage: mujoco-record ROBOT XML EFFORTS MOTION VALUE ...");
  const plumb::RobotDescription robot = plumb::LoadRobot(argv[1]);
  const auto task = plumb::MakeTask(robot);
  const plumb::Log efforts = plumb::ReadCsvLog(argv[3], robot);
  Eigen::VectorXd truth(argc - 5);
  for (int i = 5; i < argc; ++i) truth(i - 5) = std::stod(argv[i]);
  if (truth.size() != static_cast<Eigen::Index>(robot.parameters.size()))
    throw std::runtime_error("a value for each uncertain parameter is needed");
  MujocoSteps mujoco(robot, argv[2]);
  mujoco.SetParameters(truth);
  plumb::Random noise(1);
  std::string table = Header(robot);
  for (const plumb::Rollout& rollout : efforts.rollouts) {
    const plumb::Transition& first = rollout.transitions.front();
    mujoco.SetState(first.q, first.v);
    for (size_t step = 0; step < rollout.transitions.size(); ++step) {
      const plumb::Transition& t = rollout.transitions[step];
      table += fmt::format("{}", static_cast<double>(step) * robot.task.period);
      for (const double reading : mujoco.State())
        table += fmt::format(",{}", reading + kNoise * noise.Normal());
      for (int i = 0; const int joint : task->action_indices())
        table += fmt::format(",{}", t.efforts.back().effort(joint) / task->action_unit(i++));
      table += "\n";
      mujoco.Step(t.efforts);
    }
  }
  std::ofstream motion(argv[4]);
  motion << table;
  motion.close();
  if (!motion) throw std::runtime_error(std::string(argv[4]) + ": cannot be written");
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
