// libFuzzer: any ONNX file is a policy whose numbers are finite, and which comes back to the same
// bits, or it is refused.

#include "trainer/onnx_policy.h"

#include "tests/fuzz/files/input_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  ReadOrRefuse<std::invalid_argument>([&] {
    const OnnxPolicy policy = DecodeOnnxPolicy(Text(data, size));
    Require(policy.policy.parameters.allFinite());
    const OnnxPolicy again = DecodeOnnxPolicy(EncodeOnnxPolicy(policy.policy, policy.record));
    Require(again.policy.parameters == policy.policy.parameters);
  });
  return 0;
}
