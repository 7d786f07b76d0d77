// libFuzzer: whatever stands behind a right checksum is a calibrator's state, or refused.

#include "calibrator/live/checkpoint.h"
#include "common/sealed.h"
#include "tests/fuzz/files/input_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static const InputFile file("calibration.checkpoint");
  static CalibrationCheckpoint checkpoint(file.folder(), FuzzRobot(), 1);
  file.Write(Sealed({"PLUMBCAL", 8, ""}, Text(data, size)));
  ReadOrRefuse<std::runtime_error>([&] { checkpoint.Load(); });
  return 0;
}
