#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace plumb {

/// What the monkey can do.
enum class Mischief {
  kKill,        ///< a process dies, and is started again after a while
  kStall,       ///< a process stands still
  kDrop,        ///< of what one process is to hear of a topic, some is lost
  kDelay,       ///< some comes late, and so out of order
  kDouble,      ///< some comes twice
  kCorrupt,     ///< one bit of some is another
  kReplay,      ///< something genuine, said long ago, is said again
  kMadden,      ///< numbers in what a process says are mad, though its seal is right
  kGarbage,     ///< bytes that mean nothing, on a channel or on the bus
  kForge,       ///< a well-formed message with hostile values, unsealed or with a wrong seal
  kForgeFrame,  ///< a well-formed frame that somebody else is to send
  kBusDown,     ///< nobody hears a frame
  kDiskFull,    ///< a process cannot write files, or no more than some bytes of each
  kSetClock,    ///< a process has the wrong date
  kStop,        ///< a person's DISARM or ESTOP
};
inline constexpr int kMischiefs = 15;

/// One thing that the monkey does.
struct Prank {
  int64_t time = 0;  ///< [us] since the run's beginning
  Mischief what = Mischief::kKill;
  std::string whom;      ///< the process that it befalls; empty: everybody
  std::string topic;     ///< LCM channel, or kBus; empty: none
  int64_t duration = 0;  ///< [us]; 0 = at once
  double amount = 0;     ///< share of what is said, [us] of lateness or error, bytes
  uint32_t number = 0;   ///< in the script: its stream of random numbers
};

/// Stands for the bus among topics.
inline constexpr char kBus[] = "CAN";

/// The names of the processes, in the order in which they start.
std::vector<std::string> ProcessNames();

/// What a monkey does with a seed: `count` pranks within `span` [us], in order of time. The same
/// for the same arguments. @param imu whether the robot has one. Thread-safe, as Describe.
std::vector<Prank> MakeScript(uint64_t seed, int count, int64_t span, bool imu);

/// "12.345678 s: drops 30 % of JOINT_COMMAND to plumb-driver for 0.12 s"
std::string Describe(const Prank& prank);

}  // namespace plumb
