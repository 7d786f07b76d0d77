// libFuzzer: any robot.toml is read, or refused by one line that names the file.

#include "common/config.h"
#include "tests/fuzz/files/input_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static const InputFile file("robot.toml", "robot.urdf");
  file.Write(Text(data, size));
  ReadOrRefuse<ConfigError>([&] { LoadRobot(file.path()); });
  return 0;
}
