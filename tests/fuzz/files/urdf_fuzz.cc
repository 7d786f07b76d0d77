// libFuzzer: any robot.urdf is read, or refused by one line that names the file.

#include "common/config.h"
#include "tests/fuzz/files/input_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static const InputFile file("robot.urdf");
  static const bool toml = std::filesystem::copy_file(
      std::filesystem::path(std::getenv("PLUMBLINE_SOURCE")) / "robots/pendulum/robot.toml",
      file.folder() / "robot.toml", std::filesystem::copy_options::overwrite_existing);
  Require(toml);
  file.Write(Text(data, size));
  ReadOrRefuse<ConfigError>([&] { LoadRobot(file.folder()); });
  return 0;
}
