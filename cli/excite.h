#pragma once

#include <cstdint>
#include <string>

namespace plumb {

/// The flags of `plumb excite`.
struct ExciteFlags {
  std::string robot;
  std::string output = "excitation.csv";
  uint64_t seed = 1;
  int candidates = 61;
  double seconds = 10;      ///< of robot time
  bool one_by_one = false;  ///< joints
  std::string posterior;    ///< posterior.json with what is known already; empty = the prior
  std::string png;          ///< file; empty = none
};

/// `plumb excite`: looks for the efforts that would tell most of the robot's parameters and stay
/// within its limits, prints what they will tell, and writes the best ones as a table t,
/// u/<joint>... in the task's units of action, one row per control step. No messages, no buses.
/// @return exit status: 0; 1 if no excitation keeps within the limits, and no file is written then.
/// Works with a thread per core; call it from one.
/// @throws std::invalid_argument or std::runtime_error, one line for people: robot, posterior,
/// files.
int Excite(const ExciteFlags& flags);

}  // namespace plumb
