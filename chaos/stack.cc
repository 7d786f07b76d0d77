#include "chaos/stack.h"

#include <fmt/format.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmath>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "chaos/script.h"

namespace plumb {
namespace {

constexpr double kPatience = 60;  // [s] of real time for a process that is dead to be gone

void LimitFilesOf(pid_t process, double bytes) {
  rlimit limit{};
  if (prlimit(process, RLIMIT_FSIZE, nullptr, &limit) != 0) return;  // it is gone already
  limit.rlim_cur = std::isfinite(bytes) ? static_cast<rlim_t>(bytes) : limit.rlim_max;
  prlimit(process, RLIMIT_FSIZE, &limit, nullptr);
}

/// The error that a log's line tells, without what differs from run to run: the time of day and
/// the folder's name. Empty if it tells none.
std::string ErrorIn(std::string line, const std::string& folder) {
  constexpr std::string_view kError = " error ";
  const size_t error = line.find(kError);
  if (error == std::string::npos) return "";
  line.erase(0, error + kError.size());
  while (!line.empty() && line.back() == '\n') line.pop_back();
  const std::string prefix = folder + "/";
  for (size_t at; (at = line.find(prefix)) != std::string::npos;) line.erase(at, prefix.size());
  return line;
}

}  // namespace

Stack::Stack(Coordinator& coordinator, Setting setting)
    : coordinator_(coordinator), setting_(std::move(setting)) {}

/// Others write in threads of their own, so that the moment would be the machine's.
bool Stack::MayBeCut(const std::string& name) const {
  return setting_.cuts && (name == "plumb-calibrator" || name == "plumb-trainer");
}

bool Stack::IsCut(const Ending& ending) const {
  return MayBeCut(ending.name) && ending.how == fmt::format("killed by signal {}", SIGXFSZ);
}

std::vector<std::string> Stack::Arguments(const std::string& name) const {
  const std::string seed = std::to_string(setting_.seed);
  const auto in_folder = [&](const char* what) { return (setting_.folder / what).string(); };
  const std::vector<std::string> bus{"--bus", "loop:chaos"};
  std::vector<std::string> more;
  if (name == "plumb-robot") {
    more = {bus[0], bus[1], "--seed", seed};
  } else if (name == "plumb-driver") {
    more = {bus[0], bus[1], "--virtual", "--flight-recorder", in_folder("faults")};
  } else if (name == "plumb-controller") {
    more = {"--seed", seed};
  } else if (name == "plumb-calibrator") {
    more = {"--seed", seed, "--threads", "1", "--checkpoint", calibration()};
  } else if (name == "plumb-trainer") {
    more = {"--seed",
            seed,
            "--threads",
            "1",
            "--checkpoint",
            in_folder("training"),
            "--iterations",
            std::to_string(setting_.iterations),
            "--evaluation-episodes",
            std::to_string(setting_.evaluation_episodes)};
  }
  const auto here = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  std::vector<std::string> all{here / name, setting_.robot,          "--lcm-url", "memq://",
                               "--clock",   coordinator_.clock(),    "--key",     setting_.key,
                               "--parent",  std::to_string(getpid())};
  all.insert(all.end(), more.begin(), more.end());
  // Its log is a file like others: what it may tell before it ends is all that is in it.
  if (MayBeCut(name)) all.insert(all.end(), {"--log-level", "error"});
  return all;
}

void Stack::Start(const std::string& name) {
  children_.erase(name);
  const auto log = setting_.folder / (name + ".log");
  ::signal(SIGXFSZ, MayBeCut(name) ? SIG_DFL : SIG_IGN);  // which it inherits
  Child& child =
      *children_.emplace(name, std::make_unique<Child>(name, Arguments(name), log)).first->second;
  // It joins the run first, and that in our turn: what it writes is written after this.
  if (const auto limit = file_limits_.find(name); limit != file_limits_.end())
    LimitFilesOf(child.pid(), limit->second);
  coordinator_.Expect(name, child.pid());
  running_.insert(name);
}

void Stack::Kill(const std::string& name) {
  Child& child = *children_.at(name);
  child.Signal(SIGKILL);
  if (!child.WaitFor(kPatience)) throw std::runtime_error(name + " cannot be killed");
  coordinator_.AwaitEnd(name);
  running_.erase(name);
}

void Stack::LimitFiles(const std::string& name, double bytes) {
  file_limits_[name] = bytes;
  if (runs(name)) LimitFilesOf(children_.at(name)->pid(), bytes);
}

std::vector<Stack::Ending> Stack::TakeEndings() {
  std::vector<Ending> endings;
  for (const std::string& name : ProcessNames()) {
    if (!runs(name) || coordinator_.present(name)) continue;
    Child& child = *children_.at(name);
    if (!child.WaitFor(kPatience)) throw std::runtime_error(name + " has left, and does not end");
    running_.erase(name);
    endings.push_back({name, child.ending(), ErrorIn(child.Tail(1), setting_.folder)});
  }
  return endings;
}

}  // namespace plumb
