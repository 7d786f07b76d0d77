#pragma once

#include <sys/types.h>

#include <cstdint>

namespace plumb {

/// A number that this machine gives to no second process: the id in the low 22 bits (all that Linux
/// has), and above them when it was started [clock ticks since boot]. Neither allocates nor throws.
/// Thread-safe.
/// @return 0 if there is no such process.
int64_t ProcessNumber(pid_t pid) noexcept;

/// The id in a process's number.
inline pid_t ProcessId(int64_t number) noexcept { return static_cast<pid_t>(number & 0x3fffff); }

/// Whether that process runs on this machine, as far as we can see.
bool Runs(int64_t number) noexcept;

}  // namespace plumb
