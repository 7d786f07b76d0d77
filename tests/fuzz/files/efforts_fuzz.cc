// libFuzzer: any table of efforts is read, to efforts within their limits, or refused.

#include <memory>

#include "sim/tasks/effort_table.h"
#include "sim/tasks/task.h"
#include "tests/fuzz/files/input_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static const InputFile file("efforts.csv");
  static const std::unique_ptr<Task> task = MakeTask(FuzzRobot());
  file.Write(Text(data, size));
  ReadOrRefuse<std::runtime_error>([&] {
    const Eigen::MatrixXf efforts = ReadEffortTable(file.path(), FuzzRobot(), *task);
    Require(efforts.rows() > 0 && efforts.cols() == 1 && efforts.allFinite() &&
            efforts.cwiseAbs().maxCoeff() <= 1.001f);
  });
  return 0;
}
