#pragma once

#include <boost/asio/io_context.hpp>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "common/listen_address.h"
#include "dashboard/access.h"
#include "dashboard/gateway.h"
#include "http/server.h"

namespace plumb {

/// HTTP and WebSocket, on one thread, that of the context: the page, /robot.json, and what
/// Foxglove's protocol has. Everything that comes in has a bound: requests those of HttpServer,
/// without bodies; messages kMaxClientMessage, and kMaxViewers that are WebSockets, of which the
/// oldest of the address that has most makes room for a new one. Not thread-safe.
class Server {
 public:
  static constexpr size_t kMaxViewers = 64;

  struct Setting {
    ListenAddress listen;
    Access access;
    std::filesystem::path page;
    std::function<Gateway::Moment()> moment;  ///< now
  };

  /// Listens. @throws std::runtime_error naming the address, if it cannot.
  Server(boost::asio::io_context& context, const RobotDescription& robot, Gateway& gateway,
         Setting setting);
  ~Server();  ///< closes all connections

  std::string url() const { return http_.url(); }
  /// Whether somebody who looks on has not been sent everything yet.
  bool sending() const;

  struct Parts;

 private:
  std::shared_ptr<Parts> parts_;
  HttpServer http_;
};

}  // namespace plumb
