#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>

#include "robot/description.h"
#include "tests/fuzz/bytes.h"

namespace plumb {

/// The folder of the robots that we have.
inline std::filesystem::path Robots() {
  const char* const source = std::getenv("PLUMBLINE_SOURCE");
  return std::filesystem::path(source ? source : ".") / "robots";
}

/// A file of the pendulum.
inline std::filesystem::path PendulumFile(const std::string& name) {
  return Robots() / "pendulum" / name;
}

/// A folder of this process, with a file in it that becomes each of a fuzzer's inputs.
class InputFile {
 public:
  /// @param neighbour a file of the pendulum that is to be there, too; empty = none
  explicit InputFile(const std::string& name, const std::string& neighbour = {})
      : folder_(std::filesystem::temp_directory_path() /
                ("plumb_fuzz_" + std::to_string(::getpid()))),
        path_(folder_ / name) {
    std::filesystem::create_directories(folder_);
    if (!neighbour.empty())
      std::filesystem::copy_file(PendulumFile(neighbour), folder_ / neighbour,
                                 std::filesystem::copy_options::overwrite_existing);
  }
  ~InputFile() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  const std::filesystem::path& folder() const { return folder_; }
  const std::filesystem::path& path() const { return path_; }
  void Write(std::string_view content) const {
    std::ofstream(path_, std::ios::binary)
        .write(content.data(), static_cast<std::streamsize>(content.size()));
  }
  std::string Read() const {
    std::ifstream stream(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

 private:
  const std::filesystem::path folder_, path_;
};

inline std::string_view Text(const uint8_t* data, size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

/// The pendulum, whose parameters, observations and actions inputs are to fit.
inline const RobotDescription& FuzzRobot() {
  static const RobotDescription robot = LoadRobot(PendulumFile("robot.toml"));
  return robot;
}

/// An input is refused, which must not happen to a seed that leads beyond what refuses it: CTest
/// gives us those with PLUMBLINE_FUZZ_SEEDS set.
inline void Refuse(const char* why) {
  if (!std::getenv("PLUMBLINE_FUZZ_SEEDS")) return;
  std::fprintf(stderr, "this seed leads nowhere, make it anew: %s\n", why);
  std::abort();
}

/// Reads, or is refused with an Error that says something; any other exception ends the program.
template <class Error, class Read>
void ReadOrRefuse(Read read) {
  try {
    read();
  } catch (const Error& error) {
    const std::string_view what = error.what();
    if (!what.empty() && what.find('\n') == std::string_view::npos) return Refuse(error.what());
    std::fprintf(stderr, "refused, but not by one line: %s\n", error.what());
    std::abort();
  }
}

}  // namespace plumb
