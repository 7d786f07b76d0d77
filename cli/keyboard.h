#pragma once

#include <termios.h>

#include <string_view>
#include <vector>

namespace plumb {

/// What keys ask of a player.
enum class Key { kPause, kBack, kForth, kFarBack, kFarForth, kFaster, kSlower, kBeginning, kQuit };

/// What was typed: space; left and right; down and up; + and -; Home, or 0; q. Other keys are
/// passed over. Thread-safe.
std::vector<Key> KeysOf(std::string_view typed);

/// The terminal that a person types at, key by key and without echo as long as this lives. Where
/// standard input is none, nobody types. Not thread-safe.
class Keyboard {
 public:
  Keyboard();
  ~Keyboard();
  Keyboard(const Keyboard&) = delete;
  Keyboard& operator=(const Keyboard&) = delete;

  /// For poll: readable when something was typed; -1: nobody types.
  int fd() const { return fd_; }
  /// What was typed since the last call. Never blocks.
  std::vector<Key> Take();

 private:
  int fd_ = -1;
  termios before_{};
};

}  // namespace plumb
