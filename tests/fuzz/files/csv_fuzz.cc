// libFuzzer: any table is read, to finite transitions, or refused.

#include "calibrator/motion/csv_log.h"
#include "tests/fuzz/files/input_file.h"
#include "tests/fuzz/files/transitions.h"

namespace {

/// Its drive runs a position loop of its own, so that columns of targets are read, too.
plumb::RobotDescription HeldRobot() {
  plumb::RobotDescription robot = plumb::FuzzRobot();
  plumb::JointDynamics& drive = robot.joints[0].dynamics;
  drive.kp = 4, drive.kd = 0.2, drive.rest = 0.3;
  return robot;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static const InputFile file("log.csv");
  static const RobotDescription robot = HeldRobot();
  file.Write(Text(data, size));
  ReadOrRefuse<std::runtime_error>([&] { RequireFinite(ReadCsvLog(file.path(), robot).rollouts); });
  return 0;
}
