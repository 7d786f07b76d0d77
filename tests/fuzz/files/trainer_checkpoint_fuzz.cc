// libFuzzer: whatever stands behind a right checksum is a trainer's state, or refused.

#include "tests/fuzz/files/file_kind.h"
#include "tests/fuzz/files/input_file.h"
#include "trainer/checkpoint.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static const std::string example = EncodeCheckpoint(Checkpoint{});
  ReadOrRefuse<std::runtime_error>([&] {
    const Checkpoint checkpoint = DecodeCheckpoint(WithChecksum(KindOf(example), Text(data, size)));
    // a policy that is none
    ReadOrRefuse<std::invalid_argument>([&] { TrainerStateOf(checkpoint); });
  });
  return 0;
}
