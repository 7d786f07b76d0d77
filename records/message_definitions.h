#pragma once

#include <span>
#include <string_view>

namespace plumb {

/// A file of lcmtypes/, as it was when this was built.
struct MessageDefinition {
  std::string_view file;  ///< "robot_state_t.lcm"
  std::string_view text;
};

/// All messages that go over LCM, and what they are made of, in order of their files. Thread-safe.
std::span<const MessageDefinition> MessageDefinitions();

}  // namespace plumb
