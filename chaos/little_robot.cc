#include "chaos/little_robot.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "common/atomic_file.h"
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
  const fs::path below =
      fs::weakly_canonical(fs::absolute(run)).lexically_relative(fs::canonical(base.parent_path()));
  if (!below.empty() && *below.begin() != "..") {
    throw std::invalid_argument(run.string() +
                                ": is within the robot's folder, which would be copied into "
                                "itself: give another folder");
  }
  fs::copy(base.parent_path(), folder, fs::copy_options::recursive);
  fs::path file = folder / "little.toml";
  // An episode of two seconds, or a tenth of its steps where they are short.
  const int steps = std::clamp(static_cast<int>(2 / robot.task.period), 20, 100);
  WriteAtomically(
      file,
      fmt::format("extends = \"{}\"\n[task]\nsteps = {}\n[training]\nbatch = {}\nupdates = 1\n"
                  "updates_again = 1\nhidden = [8]\ncritic_epochs = 1\n",
                  base.filename().string(), steps, 4 * steps));
  return file;
}

std::string MakeKnownKey(const fs::path& file, uint64_t seed, uint32_t number) {
  Random random(seed, {kKeyStream, number});
  std::string digits;
  for (int i = 0; i < 8; ++i) digits += fmt::format("{:08x}", random.Bits());
  WriteAtomically(file, digits + "\n");
  fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write);
  return file;
}

}  // namespace plumb
