// libFuzzer: whatever stands behind a right checksum is a trainer's state, or refused.

#include "common/sealed.h"
#include "tests/fuzz/files/input_file.h"
#include "trainer/checkpoint.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static const std::string example = EncodeCheckpoint(Checkpoint{});
  uint32_t version;
  std::memcpy(&version, example.data() + 8, sizeof version);
  const Seal seal{std::string_view(example).substr(0, 8), version, ""};
  ReadOrRefuse<std::runtime_error>([&] {
    const Checkpoint checkpoint = DecodeCheckpoint(Sealed(seal, Text(data, size)));
    try {
      TrainerStateOf(checkpoint);
    } catch (const std::invalid_argument&) {
      return;  // a policy that is none
    }
  });
  return 0;
}
