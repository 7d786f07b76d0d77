// libFuzzer: any table is read, to finite transitions, or refused.

#include "calibrator/motion/csv_log.h"
#include "tests/fuzz/files/input_file.h"
#include "tests/fuzz/files/transitions.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static const InputFile file("log.csv");
  file.Write(Text(data, size));
  ReadOrRefuse<std::runtime_error>(
      [&] { RequireFinite(ReadCsvLog(file.path(), FuzzRobot()).rollouts); });
  return 0;
}
