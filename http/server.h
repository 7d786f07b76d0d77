#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "common/listen_address.h"
#include "http/http.h"

namespace plumb {

/// Answers requests over HTTP/1.1, on one thread, that of the context. Everything that comes in has
/// a bound: headers 8 kB, bodies as many bytes as the setting says, kRequestTime for each request
/// and kResponseTime for whoever reads slowly, and kMaxConnections, of which the oldest that asks
/// for nothing, or if all are being answered the oldest, makes room for a new one.
/// Not thread-safe.
class HttpServer {
 public:
  static constexpr size_t kMaxConnections = 128;
  static constexpr auto kRequestTime = std::chrono::seconds(10);  ///< from its first wait on
  static constexpr auto kResponseTime = std::chrono::seconds(30);

  /// To be called once, on the context's thread, now or later; the server may be gone by then.
  using Reply = std::function<void(Response)>;

  struct Setting {
    ListenAddress listen;
    size_t longest_body = 0;  ///< [bytes]
    /// Answers a request. Of one that asks for a WebSocket, `upgrade` is asked first.
    std::function<void(const Request& request, Reply reply)> answer;
    /// What whoever sends something else than a request is told, and why, before he is left.
    std::function<Response(const std::string& why)> refuse;
    /// A connection that becomes a WebSocket: takes the stream and returns true, or leaves it, for
    /// `answer` to say why. Empty = none does.
    std::function<bool(const Request& request, beast::tcp_stream& stream)> upgrade = {};
  };

  /// Listens. @throws std::runtime_error naming the address, if it cannot.
  HttpServer(asio::io_context& context, Setting setting);
  ~HttpServer();  ///< closes all connections, but for those that have become WebSockets

  /// Where it listens, "http://127.0.0.1:8765", "http://[::1]:8765".
  std::string url() const;

  struct Parts;

 private:
  std::shared_ptr<Parts> parts_;
};

}  // namespace plumb
