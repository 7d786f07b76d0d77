#pragma once

#include <cstddef>
#include <functional>
#include <string>

namespace plumb {

struct HttpAnswer {
  int status;
  std::string body;
};

/// Asks a server over HTTP/1.1, on a connection of its own, and waits for the answer: ten seconds
/// for its name, ten to connect and ten minutes for all the rest. Thread-safe.
/// @param server "http://HOST:PORT", "http://HOST", "http://[::1]:PORT"; a slash may follow.
/// @param path "/Evaluate". @param longest_answer [bytes]
/// @param look is called ten times a second meanwhile; what it throws ends the waiting.
/// @throws std::invalid_argument if `server` is no such address; std::runtime_error naming it if it
/// cannot be reached, or answers with something else, or with more.
HttpAnswer PostHttp(
    const std::string& server, const std::string& path, std::string body, size_t longest_answer,
    const std::function<void()>& look = [] {});

}  // namespace plumb
