#pragma once

#include <signal.h>
#include <sys/wait.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

namespace plumb {

/// Output and exit status of a command, run as by a person; status -1 if a signal ended it.
struct Outcome {
  int status;
  std::string text;  ///< both streams
};

/// @param words if any, what it must say to be interrupted (SIGINT) at once.
inline Outcome Shell(const std::string& command, const std::string& words = "") {
  std::string quoted;
  for (const char c : command) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  // A command that hangs is ended, with status 124. timeout passes our signal on to it.
  FILE* pipe = popen(
      ("echo $$; exec timeout -k 60 120 sh -c '" + quoted + "' 2>&1 </dev/null").c_str(), "r");
  REQUIRE(pipe);
  std::array<char, 4096> buffer;
  REQUIRE(fgets(buffer.data(), buffer.size(), pipe));
  const pid_t pid = std::atoi(buffer.data());
  std::string text;
  bool interrupted = words.empty();
  while (fgets(buffer.data(), buffer.size(), pipe)) {
    text += buffer.data();
    if (interrupted || text.find(words) == std::string::npos) continue;
    kill(pid, SIGINT);
    interrupted = true;
  }
  const int status = pclose(pipe);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text};
}

/// The same of a program that has been asked to end (SIGTERM) before it can look for it.
inline Outcome ShellAskedToEnd(const std::string& command) {
  return Shell("exec env --block-signal=TERM sh -c 'kill $$; exec " + command + "'");
}

/// The program under test, with a space behind it, and the robots it comes with.
inline std::string Plumb() { return std::string(std::getenv("PLUMBLINE_BUILD")) + "/bin/plumb "; }
inline std::string Robot(const std::string& name) {
  return std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/" + name;
}

inline std::string Read(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace plumb
