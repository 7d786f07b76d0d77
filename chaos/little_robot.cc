#include "chaos/little_robot.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>

#include "common/random.h"
#include "robot/description.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr uint32_t kKeyStream = 0x4b657973;  // "Keys"

}  // namespace

std::string MakeLittleRobot(const std::string& original, const fs::path& run) {
  const fs::path given = fs::absolute(original);
  const fs::path base = fs::is_directory(given) ? given / "robot.toml" : given;
  const RobotDescription robot = LoadRobot(base);
  // Beside copies of all that it may refer to.
  const fs::path folder = run / "robot";
  fs::copy(base.parent_path(), folder, fs::copy_options::recursive);
  const fs::path file = folder / "little.toml";
  // An episode of two seconds, or a tenth of its steps where they are short.
  const int steps = std::clamp(static_cast<int>(2 / robot.task.period), 20, 100);
  std::ofstream(file) << fmt::format(
      "extends = \"{}\"\n[task]\nsteps = {}\n[training]\nbatch = {}\nupdates = 1\n"
      "updates_again = 1\nhidden = [8]\ncritic_epochs = 1\n",
      base.filename().string(), steps, 4 * steps);
  return file;
}

std::string MakeKnownKey(const fs::path& file, uint64_t seed, uint32_t number) {
  Random random(seed, {kKeyStream, number});
  std::string digits;
  for (int i = 0; i < 8; ++i) digits += fmt::format("{:08x}", random.Bits());
  std::ofstream(file) << digits << "\n";
  fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write);
  return file;
}

}  // namespace plumb
