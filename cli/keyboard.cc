#include "cli/keyboard.h"

#include <poll.h>
#include <unistd.h>

#include <array>
#include <utility>

namespace plumb {

std::vector<Key> KeysOf(std::string_view typed) {
  constexpr std::array<std::pair<std::string_view, Key>, 15> kKeys{{
      {" ", Key::kPause},
      {"\x1b[D", Key::kBack},
      {"\x1bOD", Key::kBack},
      {"\x1b[C", Key::kForth},
      {"\x1bOC", Key::kForth},
      {"\x1b[B", Key::kFarBack},
      {"\x1bOB", Key::kFarBack},
      {"\x1b[A", Key::kFarForth},
      {"\x1bOA", Key::kFarForth},
      {"+", Key::kFaster},
      {"-", Key::kSlower},
      {"\x1b[H", Key::kBeginning},
      {"\x1b[1~", Key::kBeginning},
      {"0", Key::kBeginning},
      {"q", Key::kQuit},
  }};
  std::vector<Key> keys;
  while (!typed.empty()) {
    size_t length = 1;
    for (const auto& [bytes, key] : kKeys) {
      if (!typed.starts_with(bytes)) continue;
      keys.push_back(key);
      length = bytes.size();
      break;
    }
    typed.remove_prefix(length);
  }
  return keys;
}

Keyboard::Keyboard() {
  // In the background a process that reads the terminal, or changes it, is stopped.
  if (!isatty(STDIN_FILENO) || tcgetpgrp(STDIN_FILENO) != getpgrp()) return;
  if (tcgetattr(STDIN_FILENO, &before_) != 0) return;
  termios key_by_key = before_;
  key_by_key.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  key_by_key.c_cc[VMIN] = 0;
  key_by_key.c_cc[VTIME] = 0;
  if (tcsetattr(STDIN_FILENO, TCSANOW, &key_by_key) == 0) fd_ = STDIN_FILENO;
}

Keyboard::~Keyboard() {
  if (fd_ >= 0) tcsetattr(fd_, TCSANOW, &before_);
}

std::vector<Key> Keyboard::Take() {
  pollfd typed{fd_, POLLIN, 0};
  if (fd_ < 0 || poll(&typed, 1, 0) <= 0) return {};
  std::array<char, 256> bytes;
  const ssize_t size = read(fd_, bytes.data(), bytes.size());
  // A terminal that is gone would be readable for ever.
  if (size <= 0) fd_ = -1;
  return KeysOf({bytes.data(), static_cast<size_t>(size > 0 ? size : 0)});
}

}  // namespace plumb
