#include "http/server.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <list>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace plumb {
namespace {

constexpr size_t kMaxHeader = 8 << 10;  // [bytes]
constexpr auto kAcceptAgain = std::chrono::milliseconds(100);

}  // namespace

/// What all connections share. They hold it, and it knows them.
struct HttpServer::Parts {
  class Connection;
  Parts(asio::io_context& context, Setting with)
      : setting(std::move(with)), acceptor(context), again(context) {}

  const Setting setting;
  tcp::acceptor acceptor;
  asio::steady_timer again;
  std::list<std::weak_ptr<Connection>> connections;  // the oldest first
  bool ended = false;
};

/// A client that asks, one request after the other, until it goes or becomes a WebSocket.
class HttpServer::Parts::Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(std::shared_ptr<Parts> parts, tcp::socket&& socket)
      : parts_(std::move(parts)), stream_(std::move(socket)) {}
  ~Connection() { Leave(); }

  void Begin() {
    place_ = parts_->connections.insert(parts_->connections.end(), weak_from_this());
    Read();
  }
  void Close() {
    Leave();
    stream_.close();
  }
  /// Between its request's last byte and the last one of the answer.
  bool in_answer() const { return in_answer_; }

 private:
  void Leave() {
    if (place_) parts_->connections.erase(*place_);
    place_.reset();
  }

  void Read() {
    in_answer_ = false;
    parser_.emplace();
    parser_->header_limit(kMaxHeader);
    parser_->body_limit(parts_->setting.longest_body);
    stream_.expires_after(HttpServer::kRequestTime);
    http::async_read(stream_, buffer_, *parser_,
                     [self = shared_from_this()](error_code error, size_t) {
                       if (!self->place_) return;  // closed meanwhile
                       if (error) return self->OnBadRequest(error);
                       self->OnRequest();
                     });
  }

  void OnBadRequest(error_code error) {
    const bool theirs =
        error.category() == http::make_error_code(http::error::end_of_stream).category();
    if (!theirs || error == http::error::end_of_stream || error == http::error::partial_message)
      return Close();
    request_ = {};
    Respond(parts_->setting.refuse("no request that can be read: " + error.message()), false);
  }

  void OnRequest() {
    request_ = parser_->release();
    if (parts_->setting.upgrade && beast::websocket::is_upgrade(request_)) {
      stream_.expires_never();
      if (parts_->setting.upgrade(request_, stream_)) return Leave();
    }
    stream_.expires_never();  // the answer takes what it takes
    in_answer_ = true;
    parts_->setting.answer(request_, [self = shared_from_this()](Response response) {
      self->Respond(std::move(response), true);
    });
  }

  void Respond(Response response, bool keep_alive) {
    if (!place_ || parts_->ended) return;  // closed meanwhile
    response.keep_alive(keep_alive && request_.keep_alive());
    response.prepare_payload();
    if (request_.method() == http::verb::head) response.body().clear();
    response_ = std::move(response);
    stream_.expires_after(HttpServer::kResponseTime);
    http::async_write(stream_, response_, [self = shared_from_this()](error_code error, size_t) {
      if (error || !self->response_.keep_alive() || self->parts_->ended) return self->Close();
      self->Read();
    });
  }

  const std::shared_ptr<Parts> parts_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{kMaxHeader + 4096 + parts_->setting.longest_body};
  std::optional<http::request_parser<http::string_body>> parser_;
  Request request_;
  Response response_;
  bool in_answer_ = false;
  std::optional<std::list<std::weak_ptr<Connection>>::iterator> place_;
};

namespace {

void MakeRoom(const std::list<std::weak_ptr<HttpServer::Parts::Connection>>& connections) {
  if (connections.size() < HttpServer::kMaxConnections) return;
  auto oldest = std::find_if(connections.begin(), connections.end(), [](const auto& one) {
    const auto connection = one.lock();
    return connection && !connection->in_answer();
  });
  if (oldest == connections.end()) oldest = connections.begin();
  if (const auto connection = oldest->lock()) connection->Close();
}

void Accept(const std::shared_ptr<HttpServer::Parts>& parts) {
  parts->acceptor.async_accept([parts](error_code error, tcp::socket socket) {
    if (parts->ended) return;
    if (error) {  // no descriptors left, say
      parts->again.expires_after(kAcceptAgain);
      parts->again.async_wait([parts](error_code) {
        if (!parts->ended) Accept(parts);
      });
      return;
    }
    MakeRoom(parts->connections);
    std::make_shared<HttpServer::Parts::Connection>(parts, std::move(socket))->Begin();
    Accept(parts);
  });
}

}  // namespace

HttpServer::HttpServer(asio::io_context& context, Setting setting)
    : parts_(std::make_shared<Parts>(context, std::move(setting))) {
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

HttpServer::~HttpServer() {
  parts_->ended = true;
  error_code ignored;
  parts_->acceptor.close(ignored);
  parts_->again.cancel(ignored);
  for (const auto& connection : std::list(parts_->connections)) {
    if (const auto open = connection.lock()) open->Close();
  }
}

std::string HttpServer::url() const {
  std::ostringstream url;
  url << "http://" << parts_->acceptor.local_endpoint();
  return url.str();
}

}  // namespace plumb
