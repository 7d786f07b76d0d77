#include "dashboard/server.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "dashboard/connection.h"
#include "dashboard/request_answers.h"

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
  if (setting.access.TokenGiven(View(request[http::field::cookie]))) return "";
  return "whoever wants to arm must open the page by the address that was printed, with its "
         "token";
}

namespace {

using Parts = Server::Parts;

constexpr int kSendBuffer =
    256 << 10;  // [bytes] of the kernel: what is older, a slow client misses

HttpServer::Setting Serve(const std::shared_ptr<Parts>& parts) {
  return {parts->setting.listen, 0,
          [parts](const Request& request, const HttpServer::Reply& reply) {
            reply(AnswerRequest(*parts, request));
          },
          &RefuseRequest,
          [parts](const Request& request, beast::tcp_stream& stream) {
            error_code ignored;
            stream.socket().set_option(asio::socket_base::send_buffer_size(kSendBuffer), ignored);
            return UpgradeRequest(parts, request, stream);
          }};
}

}  // namespace

Server::Server(asio::io_context& context, const RobotDescription& robot, Gateway& gateway,
               Setting setting)
    : parts_(std::make_shared<Parts>(context, robot, gateway, std::move(setting))),
      http_(context, Serve(parts_)) {}

Server::~Server() {
  parts_->ended = true;
  for (const auto& connection : Parts::Places(parts_->viewers)) {
    if (const auto open = connection.lock()) open->Close();
  }
}

bool Server::sending() const {
  return std::ranges::any_of(parts_->viewers, [](const auto& connection) {
    const auto open = connection.lock();
    return open && open->sending();
  });
}

}  // namespace plumb
