// plumb-chaos: the whole stack in virtual time under a monkey that is a function of a seed.

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <stdlib.h>
#include <CLI/CLI.hpp>

#include <cerrno>
#include <charconv>
#include <iostream>
#include <string>
#include <system_error>

#include "chaos/trial.h"
#include "common/examples.h"
#include "common/process.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

struct Flags {
  std::string seeds;  // FIRST:LAST
  bool verbose = false, first = false;
  std::string keep;
  TrialSetting setting;
};

/// A folder that is gone afterwards.
class Folder {
 public:
  Folder() {
    std::string name = (fs::temp_directory_path() / "plumb-chaos-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr)
      throw std::system_error(errno, std::generic_category(), name);
    path_ = name;
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

struct Range {
  uint64_t first, last;
};

/// "3:17", or "3". @throws std::invalid_argument
Range ParseSeeds(const std::string& text) {
  Range range{};
  const char *begin = text.data(), *end = begin + text.size();
  auto read = std::from_chars(begin, end, range.first);
  range.last = range.first;
  if (read.ec == std::errc() && read.ptr != end && *read.ptr == ':')
    read = std::from_chars(read.ptr + 1, end, range.last);
  if (read.ec != std::errc() || read.ptr != end || range.last < range.first)
    throw std::invalid_argument(fmt::format("--seeds {}: expected FIRST:LAST", text));
  return range;
}

/// @throws std::invalid_argument if one of these seeds has been played there already.
void RequireNew(const fs::path& keep, const Range& seeds) {
  std::error_code ignored;  // there may be no such folder yet
  for (const fs::directory_entry& kept : fs::directory_iterator(keep, ignored)) {
    const std::string name = kept.path().filename();
    uint64_t seed = 0;
    const auto read = std::from_chars(name.data(), name.data() + name.size(), seed);
    const bool played = read.ec == std::errc() && seed >= seeds.first && seed <= seeds.last;
    if (const fs::path robot = kept.path() / "robot"; played && fs::exists(robot))
      throw std::invalid_argument(robot.string() + " is there already: give another --keep");
  }
}

std::string Row(uint64_t seed, const Outcome& outcome) {
  return fmt::format("{:6} {:7} {:8} {:12} {:9} {:9} {:8.1f}  {:016x}  {}", seed, outcome.pranks,
                     outcome.endings, outcome.transitions, outcome.messages, outcome.frames,
                     outcome.seconds, outcome.fingerprint,
                     outcome.invariant == 0 ? "-" : std::to_string(outcome.invariant));
}

int PlayAll(const Flags& flags) {
  const Range seeds = ParseSeeds(flags.seeds);
  if (!flags.keep.empty()) RequireNew(flags.keep, seeds);
  std::cout << "  seed  pranks  endings  transitions  messages    frames  seconds  fingerprint"
               "       violates\n"
            << std::flush;
  int played = 0, violated = 0;
  int64_t pranks = 0;
  bool more = true;  // the last of them may be the greatest number there is
  for (uint64_t seed = seeds.first; more; more = seed++ != seeds.last) {
    const Folder folder;
    TrialSetting setting = flags.setting;
    setting.seed = seed;
    setting.folder =
        flags.keep.empty() ? folder.path() : fs::path(flags.keep) / std::to_string(seed);
    fs::create_directories(setting.folder);
    const Outcome outcome = Play(setting, [&](const std::string& line) {
      if (flags.verbose) std::cout << line << std::endl;
    });
    ++played;
    pranks += outcome.pranks;
    std::cout << Row(seed, outcome) << std::endl;
    if (outcome.invariant == 0) continue;
    ++violated;
    std::cout << fmt::format("seed {} violates \"{}\"\n{}", seed,
                             NameOfInvariant(outcome.invariant), outcome.story)
              << std::endl;
    if (flags.first) break;
  }
  std::cout << fmt::format("{} seeds, {} pranks, {} seeds with a violation\n", played, pranks,
                           violated);
  return violated == 0 ? 0 : 1;
}

int Main(int argc, char** argv) {
  Flags flags;
  flags.seeds = "1";
  CLI::App app{"Runs the whole stack in virtual time and does it mischief, the same for a seed.",
               "plumb-chaos"};
  TrialSetting& setting = flags.setting;
  app.add_option("robot", setting.robot, "robot folder or TOML file, with motors of CANSimple")
      ->required();
  app.add_option("--seed,--seeds", flags.seeds, "one seed, or FIRST:LAST")->capture_default_str();
  app.add_option("--pranks", setting.pranks, "of a seed")
      ->check(CLI::Range(0, 10000))
      ->capture_default_str();
  app.add_option("--span", setting.span, "[s] of virtual time in which they happen")
      ->check(CLI::Range(0.1, 10000.0))
      ->capture_default_str();
  app.add_option("--iterations", setting.iterations, "of calibration")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  app.add_option("--patience", setting.patience,
                 "[s] of virtual time after the last of them until there has to be a result")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  app.add_flag("--first", flags.first, "stop at the first seed that violates something");
  app.add_flag("--verbose", flags.verbose, "print what the monkey does");
  app.add_option("--keep", flags.keep, "a folder to leave each seed's logs and checkpoints in");
  AddExamples(app, {"plumb-chaos robots/pendulum --seed 7 --verbose",
                    "plumb-chaos robots/pendulum --seeds 1:200 --first"});
  app.set_version_flag("--version", VersionLine("plumb-chaos"));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  spdlog::set_level(spdlog::level::off);  // whom we do not believe is part of the game
  return PlayAll(flags);
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  try {
    return plumb::Main(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "plumb-chaos: " << error.what() << std::endl;
    return 2;
  }
}
