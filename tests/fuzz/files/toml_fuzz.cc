// libFuzzer: any robot.toml is read, or refused by one line that names the file. Beside it are the
// pendulum's robot.urdf and all robots' folders, whose files it may extend and name.

#include "common/config.h"
#include "tests/fuzz/files/input_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static const InputFile file("robot.toml", "robot.urdf");
  [[maybe_unused]] static const bool copied = [] {
    std::filesystem::copy(Robots(), file.folder(),
                          std::filesystem::copy_options::recursive |
                              std::filesystem::copy_options::overwrite_existing);
    return true;
  }();
  file.Write(Text(data, size));
  ReadOrRefuse<ConfigError>([&] { LoadRobot(file.path()); });
  return 0;
}
