// libFuzzer: any LCM log is read, to finite transitions, or refused.

#include "calibrator/motion/lcm_log.h"
#include "tests/fuzz/files/input_file.h"
#include "tests/fuzz/files/transitions.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static const InputFile file("run.lcmlog");
  file.Write(Text(data, size));
  ReadOrRefuse<std::runtime_error>(
      [&] { RequireFinite(ReadLcmLog(file.path(), FuzzRobot()).rollouts); });
  return 0;
}
