#include "records/listeners.h"

#include <fmt/format.h>

#include <charconv>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <system_error>

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// Of what vanishes while it is looked at, and of what is another user's, nothing is seen.
template <class Use>
void ForEachEntry(const fs::path& folder, Use use) {
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    use(entry->path());
  }
}

bool IsOurs(pid_t process) {
  std::error_code error;
  const fs::path program = fs::read_symlink(fmt::format("/proc/{}/exe", process), error);
  return program.filename().string().starts_with("plumb");
}

bool AllWait(pid_t process) {
  bool wait = true;
  ForEachEntry(fmt::format("/proc/{}/task", process), [&](const fs::path& thread) {
    std::ifstream stream(thread / "stat");
    const std::string text{std::istreambuf_iterator<char>(stream), {}};
    // Its name, in parentheses, may hold anything; then comes the state: proc(5).
    const size_t state = text.rfind(") ");
    if (state == std::string::npos || state + 2 >= text.size()) return;
    const char letter = text[state + 2];
    wait = wait && letter != 'R' && letter != 'D';
  });
  return wait;
}

}  // namespace

std::vector<Listener> Listeners::Look() {
  std::vector<Listener> listeners;
  for (const ReceiveQueue& queue : ReceiveQueues(port_)) {
    auto process = processes_.find(queue.socket);
    if (process == processes_.end()) {
      const pid_t owner = FindOwner(queue.socket);
      process = processes_.emplace(queue.socket, owner != 0 && IsOurs(owner) ? 0 : owner).first;
    }
    listeners.push_back({queue, process->second != 0 && !Rests(process->second)});
  }
  return listeners;
}

pid_t FindOwner(uint64_t socket) {
  const std::string wanted = fmt::format("socket:[{}]", socket);
  pid_t owner = 0;
  ForEachEntry("/proc", [&](const fs::path& folder) {
    const std::string name = folder.filename();
    pid_t process = 0;
    if (owner != 0 ||
        std::from_chars(name.data(), name.data() + name.size(), process).ptr == name.data())
      return;
    ForEachEntry(folder / "fd", [&](const fs::path& link) {
      std::error_code error;
      if (fs::read_symlink(link, error).native() == wanted) owner = process;
    });
  });
  return owner;
}

// Twice: while one thread is looked at, another, looked at before, may have been woken by it.
bool Rests(pid_t process) { return AllWait(process) && AllWait(process); }

}  // namespace plumb
