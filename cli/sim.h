#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/process.h"

namespace plumb {

/// The flags of `plumb sim`.
struct SimFlags {
  std::string robot;
  std::string policy;   ///< file; empty = none
  std::string efforts;  ///< table of efforts to play; empty = none
  bool random = false;
  uint64_t seed = 1;
  int episodes = 1;
  std::string noise = "0";    ///< of readings: "0.003" or "0.001,0.05"
  std::string csv, png, gif;  ///< files; empty = none
  /// posterior.json, its means for the prior's, and its residual; empty = the prior
  std::string posterior;
  std::vector<std::string> set;  ///< "mass/thigh=4"
  bool urdf = false;             ///< forget the uncertain parameters' prior means
};

/// `plumb sim`: rolls a policy, a table of efforts, random actions or no action out in the
/// simulator, without messages or buses, and says how it went. @return exit status: 0, or 130 if it
/// was interrupted; then it writes no files. Runs in one thread.
/// @throws std::invalid_argument or std::runtime_error, one line for people: robot, policy, files.
int Simulate(Process& process, const SimFlags& flags);

}  // namespace plumb
