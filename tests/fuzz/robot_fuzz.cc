// Robots with mistakes in their files: each is read, and simulated a little, or refused with one
// line that says where. Anything else ends the program. A mutant has a number: --first 1234 --count
// 1 makes it again.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <regex>
#include <vector>

#include "common/config.h"
#include "robot/description.h"
#include "robot/parameter_distribution.h"
#include "tests/fuzz/mutator.h"
#include "tests/fuzz/simulate.h"
#include "tests/robot/zoo.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

struct Files {
  std::string name, urdf, toml;
};

struct Counts {
  int64_t refused = 0, with_line = 0, refused_simulator = 0, not_finite = 0, simulated = 0,
          failed = 0;
  // by message, without what varies
  std::map<std::string, int64_t> refusals, without_line, simulator;
};

std::vector<Files> Originals(const std::string& source) {
  std::vector<Files> originals{{"zoo", kZooUrdf, kZooToml}};
  std::vector<fs::path> folders;
  for (const auto& entry : fs::directory_iterator(fs::path(source) / "robots"))
    folders.push_back(entry.path());
  std::sort(folders.begin(), folders.end());
  for (const fs::path& folder : folders) {
    if (!fs::exists(folder / "robot.urdf") || !fs::exists(folder / "robot.toml")) continue;
    originals.push_back(
        {folder.filename(), ReadFile(folder / "robot.urdf"), ReadFile(folder / "robot.toml")});
  }
  return originals;
}

// The invariants of a description that its readers rely on.
void RequireValid(const RobotDescription& robot) {
  const auto require = [](bool right, const char* what) {
    if (!right) throw std::logic_error(std::string("a valid robot whose ") + what);
  };
  require(robot.links.size() == robot.joints.size() + 1, "links are not one more than its joints");
  require(!robot.driven().empty(), "joints are all passive");
  require(!robot.parameters.empty(), "parameters are none");
  for (size_t i = 0; i < robot.joints.size(); ++i) {
    const JointDescription& joint = robot.joints[i];
    require(joint.child == static_cast<int>(i) + 1 && joint.parent >= 0 &&
                joint.parent <= static_cast<int>(i),
            "joints are no tree");
    require(joint.origin.allFinite() && joint.rotation.allFinite(), "joints are nowhere");
    require(std::abs(joint.axis.norm() - 1) < 1e-9, "axes have no length");
    require(joint.lower < joint.upper, "limits exclude everything");
    require(joint.passive ? joint.effort_limit == 0
                          : joint.effort_limit > 0 && std::isfinite(joint.effort_limit),
            "efforts are none");
    require(joint.velocity_limit > 0, "velocities are none");
  }
  for (const LinkDescription& link : robot.links) {
    require(link.mass >= 0 && std::isfinite(link.mass) && link.center_of_mass.allFinite() &&
                link.inertia.allFinite(),
            "masses are none");
  }
  require(robot.task.target.size() == static_cast<size_t>(robot.num_positions()),
          "target is of another robot");
  require(robot.task.spread.size() == static_cast<size_t>(robot.num_positions()),
          "spread is of another robot");
  const ParameterDistribution prior = ParameterDistribution::Prior(robot);
  require(ParameterDistribution::FromMessage(prior.ToMessage(), robot).Mean().allFinite(),
          "prior cannot be sent");
}

void Count(const SimulatorOutcome& outcome, Counts& counts) {
  if (outcome.refusal.empty()) {
    ++counts.simulated;
    if (!outcome.finite) ++counts.not_finite;
    return;
  }
  ++counts.refused_simulator;
  ++counts.simulator[std::regex_replace(outcome.refusal.substr(0, 90), std::regex("[0-9]+"), "#")];
}

// @return false for an outcome that must not be.
bool Try(const RobotFolder& folder, Counts& counts) {
  try {
    const RobotDescription robot = LoadRobot(folder.path());
    RequireValid(robot);
    Count(Simulate(robot), counts);
    return true;
  } catch (const ConfigError& error) {
    const std::string text = error.what();
    static const std::regex kLine("(robot\\.(toml|urdf)):[0-9]+:");
    if (text.find(folder.path()) != 0) {
      fmt::print(stderr, "an error without its file: {}\n", text);
      return false;
    }
    ++counts.refused;
    const std::string rest = text.substr(folder.path().size() + 1);
    const bool line = std::regex_search(rest.substr(0, 40), kLine);
    counts.with_line += line;
    std::string kind =
        std::regex_replace(rest.substr(0, 200), std::regex("[0-9]+"), "#").substr(0, 70);
    ++counts.refusals[kind];
    if (!line) ++counts.without_line[kind];
    return true;
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}: {}\n", typeid(error).name(), error.what());
    return false;
  }
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  using namespace plumb;
  uint64_t seed = 1;
  int64_t first = 0, count = 3000;
  bool keep = false, verbose = false;
  std::string source = std::getenv("PLUMBLINE_SOURCE") ? std::getenv("PLUMBLINE_SOURCE") : ".";
  CLI::App app("Reads robots with mistakes in their files");
  app.add_option("--seed", seed, "of the mistakes");
  app.add_option("--first", first, "number of the first mutant");
  app.add_option("--count", count, "of mutants");
  app.add_option("--source", source, "folder with robots/");
  app.add_flag("--keep", keep, "print the last mutant's files");
  app.add_flag("--verbose", verbose, "print every mutant's number, and kinds of errors at the end");
  CLI11_PARSE(app, argc, argv);

  const std::vector<Files> originals = Originals(source);
  const RobotFolder folder("", "");
  Counts counts;
  double slowest = 0;
  for (int64_t i = first; i < first + count; ++i) {
    Random random(seed, {static_cast<uint32_t>(i)});
    const Files& original = originals[static_cast<size_t>(i) % originals.size()];
    const uint32_t which = random.Bits() % 4;
    const std::string urdf = which == 0 ? original.urdf : Mutate(original.urdf, random);
    const std::string toml =
        which == 0 || which == 3 ? Mutate(original.toml, random) : original.toml;
    folder.Write(urdf, toml);
    if (verbose) fmt::print(stderr, "mutant {} of {}\n", i, original.name);
    if (keep && i == first + count - 1) fmt::print("{}\n{}\n", urdf, toml);
    const auto start = std::chrono::steady_clock::now();
    if (!Try(folder, counts)) {
      fmt::print(stderr, "mutant {} of {}: --seed {} --first {} --count 1\n", i, original.name,
                 seed, i);
      ++counts.failed;
    }
    const double duration =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (duration > slowest) {
      slowest = duration;
      if (verbose) fmt::print(stderr, "slowest until now: mutant {}, {:.3f} s\n", i, slowest);
    }
  }
  fmt::print(
      "{} mutants of {} robots: {} refused, {:.2f} % of them with a line; {} simulated, {} of them "
      "not "
      "finite; "
      "{} refused by the simulator; {} failed; the slowest took {:.3f} s\n",
      count, originals.size(), counts.refused,
      100. * static_cast<double>(counts.with_line) /
          static_cast<double>(std::max<int64_t>(1, counts.refused)),
      counts.simulated, counts.not_finite, counts.refused_simulator, counts.failed, slowest);
  const auto print = [](const char* title, const std::map<std::string, int64_t>& kinds) {
    for (const auto& [kind, number] : kinds) fmt::print("  {} {:6} {}\n", title, number, kind);
  };
  if (verbose)
    print("refused:", counts.refusals), print("without line:", counts.without_line),
        print("simulator:", counts.simulator);
  return counts.failed == 0 ? 0 : 1;
}
