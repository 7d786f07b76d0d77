// libFuzzer: whatever stands behind a right checksum is a calibrator's state and its roll-out, a
// line each, or refused.

#include "calibrator/live/checkpoint.h"

#include "tests/fuzz/files/file_kind.h"
#include "tests/fuzz/files/input_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static const InputFile state("calibration.checkpoint"), rollout("rollout_0.checkpoint");
  static CalibrationCheckpoint checkpoint(state.folder(), FuzzRobot(), 1);
  static const std::string example = [] {
    checkpoint.Save({});
    return state.Read();
  }();
  const std::string_view text = Text(data, size);
  const size_t line = std::min(text.find('\n'), size);
  state.Write(WithChecksum(KindOf(example), text.substr(0, line)));
  rollout.Write(WithChecksum(KindOf(example), text.substr(std::min(line + 1, size))));
  ReadOrRefuse<std::runtime_error>([&] { checkpoint.Load(); });
  return 0;
}
