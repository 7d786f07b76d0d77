#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "cli/child.h"
#include "common/lockstep/coordinator.h"

namespace plumb {

/// The six processes of a run in virtual time, each of which may die and be started again at any
/// moment of it. Not thread-safe.
class Stack {
 public:
  struct Setting {
    std::string robot;             ///< its TOML file
    std::filesystem::path folder;  ///< of the run: logs, checkpoints, the clock
    std::string key;               ///< file of the key
    uint64_t seed = 1;
    int iterations = 1;
    int evaluation_episodes = 1;
    /// Where a file may not become longer, calibrator and trainer are killed in the middle of
    /// writing it, as by a power cut; otherwise the write fails, as on a full disk.
    bool cuts = false;
  };
  /// How a process has ended that nobody has killed.
  struct Ending {
    std::string name;
    std::string how;  ///< "exit status 1", "killed by signal 11"
    std::string why;  ///< the error that is the last line of its log; empty if none is
  };

  Stack(Coordinator& coordinator, Setting setting);

  /// Not while it runs. @throws std::runtime_error if it cannot be started.
  void Start(const std::string& name);
  /// It is dead at this moment.
  void Kill(const std::string& name);
  /// From now on no file of that process may become longer than `bytes`, whenever it is started;
  /// infinity: as long as it likes.
  void LimitFiles(const std::string& name, double bytes);
  bool runs(const std::string& name) const { return running_.contains(name); }
  /// Those who have ended by themselves since the last call.
  std::vector<Ending> TakeEndings();

  /// Whether a process ends so in the middle of writing.
  bool IsCut(const Ending& ending) const;
  std::filesystem::path calibration() const { return setting_.folder / "calibration"; }

 private:
  bool MayBeCut(const std::string& name) const;
  std::vector<std::string> Arguments(const std::string& name) const;

  Coordinator& coordinator_;
  const Setting setting_;
  std::map<std::string, std::unique_ptr<Child>> children_;
  std::set<std::string> running_;  // as far as has been noticed
  std::map<std::string, double> file_limits_;
};

}  // namespace plumb
