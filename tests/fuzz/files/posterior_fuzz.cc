// libFuzzer: any posterior.json is read, to numbers that can be drawn from, or refused.

#include "robot/posterior_reader.h"
#include "tests/fuzz/files/input_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static const InputFile file("posterior.json");
  file.Write(Text(data, size));
  ReadOrRefuse<std::runtime_error>([&] {
    const ParameterDistribution distribution = ReadPosterior(file.path(), FuzzRobot());
    Random random(1);
    Require(distribution.SampleCoordinates(random).allFinite());
  });
  return 0;
}
