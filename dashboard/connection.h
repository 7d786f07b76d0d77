#pragma once

#include <list>
#include <memory>

#include "dashboard/page.h"
#include "dashboard/server.h"

// What requests and WebSockets share. All of it on the context's thread.
namespace plumb {

/// A WebSocket.
struct Connection {
  virtual ~Connection() = default;
  virtual void Close() = 0;
  virtual bool sending() const = 0;
  asio::ip::address address;  // of the other side
};

/// What all connections share. They hold it, and it knows them.
struct Server::Parts {
  Parts(asio::io_context& where, const RobotDescription& description, Gateway& to, Setting with)
      : context(where),
        robot(description),
        gateway(to),
        setting(std::move(with)),
        page(setting.page) {}

  using Places = std::list<std::weak_ptr<Connection>>;

  /// Whoever opens any number of WebSockets keeps nobody else from the emergency stop: of the
  /// address that has most of them the oldest goes.
  void MakeRoomForViewer();
  /// Why whoever asks like this may not arm, whatever the run is; empty = he may.
  std::string WhyNotArm(const Request& request) const;

  asio::io_context& context;
  const RobotDescription robot;
  Gateway& gateway;
  const Setting setting;
  const PageFolder page;
  Places viewers;  // the oldest first
  bool ended = false;
};

/// A place among the viewers, for as long as it lives.
class Place {
 public:
  Place(Server::Parts::Places& places, const std::shared_ptr<Connection>& who)
      : places_(places), where_(places.insert(places.end(), who)) {}
  ~Place() { places_.erase(where_); }
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;

 private:
  Server::Parts::Places& places_;
  const Server::Parts::Places::iterator where_;
};

}  // namespace plumb
