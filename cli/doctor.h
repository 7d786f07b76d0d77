#pragma once

#include <string>
#include <vector>

namespace plumb {

/// One thing `plumb doctor` looked at.
struct Finding {
  enum class Level { kGood, kAdvice, kBad };
  Level level;
  std::string what;
  std::string cure;  ///< a command, empty if all is well
};

/// Looks at everything a run needs of this machine: multicast, who may command the robot, UDP
/// buffers, CAN, real-time limits, packages. Changes nothing. @param buses URLs of those that are
/// going to be used. @param key file of the key that commands are going to be signed with; empty =
/// none.
std::vector<Finding> Examine(const std::string& lcm_url, const std::vector<std::string>& buses,
                             const std::string& key = {});

/// Prints the findings. Not thread-safe: it opens LCM and the buses. @return exit status: 1 if any
/// is bad.
int Doctor(const std::string& lcm_url, const std::vector<std::string>& buses,
           const std::string& key);

}  // namespace plumb
