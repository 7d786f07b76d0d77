#pragma once

#include <boost/asio/io_context.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "common/listen_address.h"
#include "dashboard/access.h"
#include "dashboard/gateway.h"
#include "dashboard/page.h"

namespace plumb {

/// HTTP and WebSocket, on one thread, that of the context: the page, /robot.json, and what
/// Foxglove's protocol has. Everything that comes in has a bound: requests 8 kB and 10 s, messages
/// kMaxClientMessage, kMaxConnections that are no WebSockets, of which the one that has waited
/// longest makes room for a new one, and kMaxViewers that are, of which the oldest of the address
/// that has most does. Not thread-safe.
class Server {
 public:
  static constexpr size_t kMaxConnections = 128, kMaxViewers = 64;

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

  uint16_t port() const;
  /// Whether somebody who looks on has not been sent everything yet.
  bool sending() const;

  struct Parts;

 private:
  std::shared_ptr<Parts> parts_;
};

}  // namespace plumb
