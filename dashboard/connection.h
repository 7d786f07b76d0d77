#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <list>
#include <memory>
#include <string_view>

#include "dashboard/server.h"

// What the server and its two kinds of connection share. All of it on the context's thread.
namespace plumb {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using boost::system::error_code;

using Request = http::request<http::empty_body>;
using Response = http::response<http::string_body>;

inline constexpr auto kRequestTime =
    std::chrono::seconds(10);  ///< for a request, from its first wait on

inline std::string_view View(boost::string_view text) { return {text.data(), text.size()}; }

struct Connection {
  virtual ~Connection() = default;
  virtual void Close() = 0;
  virtual bool sending() const { return false; }
  asio::ip::address address;  // of the other side
};

/// What all connections share. They hold it, and it knows them.
struct Server::Parts {
  Parts(asio::io_context& where, const RobotDescription& description, Gateway& to, Setting with)
      : context(where),
        robot(description),
        gateway(to),
        setting(std::move(with)),
        page(setting.page),
        acceptor(context),
        again(context) {}

  using Places = std::list<std::weak_ptr<Connection>>;

  /// Whoever opens any number of WebSockets keeps nobody else from the emergency stop: of the
  /// address that has most of them the oldest goes.
  void MakeRoomForViewer();
  /// Why whoever asks like this may not arm; empty = he may.
  std::string WhyNotArm(const Request& request) const;

  asio::io_context& context;
  const RobotDescription robot;
  Gateway& gateway;
  const Setting setting;
  const Page page;
  tcp::acceptor acceptor;
  asio::steady_timer again;
  Places requests, viewers;  // connections of each kind, the oldest first
  bool ended = false;
};

/// A place in one of the lists, for as long as it lives.
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
