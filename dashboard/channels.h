#pragma once

#include <span>
#include <string_view>

namespace plumb {

/// A channel of docs/messages.md, as the page is told of it.
struct ChannelOfPage {
  std::string_view name, type;
  bool fast;  ///< only its newest messages matter: nothing of it is kept for those who come late
  bool tells_time;  ///< its utime is the moment at which it was said, or measured
};

/// All there are, but for the lockstep's, which are no channels. Thread-safe.
std::span<const ChannelOfPage> ChannelsOfPage();
/// Whether it is one of these. Thread-safe.
bool IsChannelOfPage(std::string_view name);

}  // namespace plumb
