#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "robot/description.h"

namespace plumb {

/// One run of the whole stack under a monkey. All of it follows from these.
struct TrialSetting {
  std::string robot;  ///< folder or TOML file
  uint64_t seed = 1;
  int pranks = 50;
  double span = 12;  ///< [s] of virtual time in which they happen
  int iterations = 2;
  /// [s] of virtual time after the last of them in which the run has to come to its result
  double patience = 60;
  std::filesystem::path folder;  ///< of the run, empty
};

struct Outcome {
  int invariant = 0;    ///< that was violated first; 0 = none
  std::string story;    ///< of the violation, for people
  int pranks = 0;       ///< that were played
  int endings = 0;      ///< of processes that ended by themselves, with a reason
  int transitions = 0;  ///< accepted
  int64_t messages = 0, frames = 0;
  double seconds = 0;        ///< of virtual time
  uint64_t fingerprint = 0;  ///< of all that was said: the same for the same setting
};

/// The invariants, by number.
const char* NameOfInvariant(int invariant);

/// Plays it. The same setting has the same outcome. Starts processes, and leaves none behind. Not
/// thread-safe. @param on_prank called with each line of what the monkey does.
/// @throws std::invalid_argument or std::runtime_error, one line for people, if it cannot begin.
Outcome Play(const TrialSetting& setting,
             const std::function<void(const std::string&)>& on_prank = {});

}  // namespace plumb
