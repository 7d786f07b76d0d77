#pragma once

#include <catch2/catch.hpp>
#include <filesystem>
#include <string>

#include "tests/cli/shell.h"

namespace plumb {

/// Whether tests can start several ranks here; warns if not.
inline bool HaveMpirun() {
#ifdef PLUMB_MPI
  if (Shell("command -v mpirun").status == 0) return true;
#endif
  WARN("skipped: OpenMPI (libopenmpi-dev, openmpi-bin) is not installed");
  return false;
}

/// A command as several ranks on this machine, however few processors it has. What OpenMPI leaves
/// behind is none of the leak sanitizer's business.
inline std::string Mpirun(int ranks, const std::string& command) {
  return "ASAN_OPTIONS=detect_leaks=0 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 "
         "timeout 110 mpirun "
         "--oversubscribe -n " +
         std::to_string(ranks) + " " + command;
}

/// One hidden test case of the program that is running.
inline std::string HiddenTest(const std::string& tag) {
  return std::filesystem::read_symlink("/proc/self/exe").string() + " '[." + tag + "]'";
}

}  // namespace plumb
