#include "dashboard/server.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

#include "dashboard/connection.h"
#include "dashboard/request_connection.h"

namespace plumb {

void Server::Parts::MakeRoomForViewer() {
  if (viewers.size() < kMaxViewers) return;
  std::map<asio::ip::address, size_t> of;
  size_t most = 0;
  std::vector<std::shared_ptr<Connection>> open;
  for (const auto& viewer : viewers) {
    open.push_back(viewer.lock());
    most = std::max(most, ++of[open.back()->address]);
  }
  const auto oldest = std::ranges::find_if(
      open, [&](const auto& connection) { return of[connection->address] == most; });
  (*oldest)->Close();
}

std::string Server::Parts::WhyNotArm(const Request& request) const {
  const std::string why = gateway.WhyNotArm();
  if (!why.empty() || setting.access.TokenGiven(View(request[http::field::cookie]))) return why;
  return "whoever wants to arm must open the page by the address that was printed, with its "
         "token";
}

namespace {

using Parts = Server::Parts;

constexpr auto kAcceptAgain = std::chrono::milliseconds(100);
constexpr int kSendBuffer =
    256 << 10;  // [bytes] of the kernel: what is older, a slow client misses

void Accept(const std::shared_ptr<Parts>& parts) {
  parts->acceptor.async_accept([parts](error_code error, tcp::socket socket) {
    if (parts->ended) return;
    if (error) {  // no descriptors left, say
      parts->again.expires_after(kAcceptAgain);
      parts->again.async_wait([parts](error_code) {
        if (!parts->ended) Accept(parts);
      });
      return;
    }
    if (parts->requests.size() >= Server::kMaxConnections) {
      if (const auto oldest = parts->requests.front().lock()) oldest->Close();
    }
    error_code ignored;
    socket.set_option(asio::socket_base::send_buffer_size(kSendBuffer), ignored);
    BeginRequests(parts, std::move(socket));
    Accept(parts);
  });
}

}  // namespace

Server::Server(asio::io_context& context, const RobotDescription& robot, Gateway& gateway,
               Setting setting)
    : parts_(std::make_shared<Parts>(context, robot, gateway, std::move(setting))) {
  const ListenAddress& listen = parts_->setting.listen;
  try {
    const tcp::endpoint endpoint(asio::ip::make_address(listen.address), listen.port);
    parts_->acceptor.open(endpoint.protocol());
    parts_->acceptor.set_option(asio::socket_base::reuse_address(true));
    parts_->acceptor.bind(endpoint);
    parts_->acceptor.listen();
  } catch (const boost::system::system_error& error) {
    throw std::runtime_error(fmt::format("cannot listen on {}:{}: {}", listen.address, listen.port,
                                         error.code().message()));
  }
  Accept(parts_);
}

Server::~Server() {
  parts_->ended = true;
  error_code ignored;
  parts_->acceptor.close(ignored);
  parts_->again.cancel(ignored);
  for (const auto* places : {&parts_->requests, &parts_->viewers}) {
    for (const auto& connection : Parts::Places(*places)) {
      if (const auto open = connection.lock()) open->Close();
    }
  }
}

bool Server::sending() const {
  return std::ranges::any_of(parts_->viewers, [](const auto& connection) {
    const auto open = connection.lock();
    return open && open->sending();
  });
}

uint16_t Server::port() const { return parts_->acceptor.local_endpoint().port(); }

}  // namespace plumb
