#pragma once

#include <cstddef>
#include <string>

namespace plumb {

struct HttpAnswer {
  int status;
  std::string body;
};

/// Asks a server over HTTP/1.1, on a connection of its own, and waits for the answer: ten seconds
/// to connect and ten minutes for all the rest. Thread-safe.
/// @param server "http://HOST:PORT", "http://HOST"; a slash may follow. @param path "/Evaluate".
/// @param longest_answer [bytes]
/// @throws std::invalid_argument if `server` is no such address; std::runtime_error naming it if it
/// cannot be reached, or answers with something else, or with more.
HttpAnswer PostHttp(const std::string& server, const std::string& path, std::string body,
                    size_t longest_answer);

}  // namespace plumb
