#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace plumb {

/// A process this one has started, in a process group of its own: a Ctrl-C at the terminal reaches
/// only us, and we stop the others in the right order. Destroying it kills it. Not thread-safe.
class Child {
 public:
  /// @param arguments argv, the program first. @param log receives its standard output and error.
  /// @throws std::runtime_error if it cannot be started.
  Child(std::string name, const std::vector<std::string>& arguments,
        const std::filesystem::path& log);
  Child(Child&& other) noexcept;
  Child& operator=(Child&&) = delete;
  ~Child();

  const std::string& name() const { return name_; }
  const std::filesystem::path& log() const { return log_; }
  pid_t pid() const { return pid_; }
  /// Never blocks.
  bool running();
  /// "exit status 1", "killed by signal 9"; empty while it runs.
  std::string ending() const;
  bool failed() const { return status_ && *status_ != 0; }
  void Signal(int signal);
  /// Waits until it has ended, at most `seconds`. @return true if it has.
  bool WaitFor(double seconds);
  /// The last lines that it has written to its log, which may have those of earlier runs.
  std::string Tail(size_t lines) const;

 private:
  std::string name_;
  std::filesystem::path log_;
  uintmax_t begins_;  ///< in the log
  pid_t pid_ = -1;
  std::optional<int> status_;
};

}  // namespace plumb
