#pragma once

#include <sys/wait.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

namespace plumb {

/// What a command that was run as a person would has said and how it ended; -1 if by a signal.
struct Outcome {
  int status;
  std::string text;  ///< both streams
};

inline Outcome Shell(const std::string& command) {
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  REQUIRE(pipe);
  std::string text;
  std::array<char, 4096> buffer;
  while (const size_t count = fread(buffer.data(), 1, buffer.size(), pipe)) text.append(buffer.data(), count);
  const int status = pclose(pipe);
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text};
}

/// The program under test, with a space behind it, and the robots it comes with.
inline std::string Plumb() { return std::string(std::getenv("PLUMBLINE_BUILD")) + "/bin/plumb "; }
inline std::string Robot(const std::string& name) { return std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/" + name; }

inline std::string Read(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace plumb
