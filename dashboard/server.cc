#include "dashboard/server.h"

#include <fmt/format.h>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <list>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "dashboard/foxglove.h"
#include "dashboard/robot_json.h"
#include "dashboard/viewer.h"

namespace plumb {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using boost::system::error_code;

namespace {

using Request = http::request<http::empty_body>;
using Response = http::response<http::string_body>;

constexpr auto kRequestTime = std::chrono::seconds(10);   // for a request, from its first wait on
constexpr auto kResponseTime = std::chrono::seconds(30);  // for whoever reads slowly
constexpr auto kSilence = std::chrono::seconds(60);       // of a WebSocket, then it is asked
constexpr auto kAcceptAgain = std::chrono::milliseconds(100);
constexpr size_t kMaxHeader = 8 << 10;  // [bytes]
constexpr int kSendBuffer =
    256 << 10;  // [bytes] of the kernel: what is older, a slow client misses

std::string_view View(boost::string_view text) { return {text.data(), text.size()}; }

struct Connection {
  virtual ~Connection() = default;
  virtual void Close() = 0;
  virtual bool sending() const { return false; }
  asio::ip::address address;  // of the other side
};

asio::ip::address AddressOf(const tcp::socket& socket) {
  error_code gone;
  return socket.remote_endpoint(gone).address();
}

}  // namespace

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
  void MakeRoomForViewer() {
    if (viewers.size() < kMaxViewers) return;
    std::map<asio::ip::address, size_t> of;
    size_t most = 0;
    std::vector<std::shared_ptr<Connection>> open;
    for (const auto& viewer : viewers) {
      open.push_back(viewer.lock());
      most = std::max(most, ++of[open.back()->address]);
    }
    (*std::ranges::find_if(open, [&](const auto& one) {
      return of[one->address] == most;
    }))->Close();
  }

  std::string WhyNotArm(const Request& request) const {
    const std::string why = gateway.WhyNotArm();
    if (!why.empty() || setting.access.TokenGiven(View(request[http::field::cookie]))) return why;
    return "whoever wants to arm must open the page by the address that was printed, with its "
           "token";
  }

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

namespace {

using Parts = Server::Parts;

/// A place in one of the lists, for as long as it lives.
class Place {
 public:
  Place(Parts::Places& places, const std::shared_ptr<Connection>& who)
      : places_(places), where_(places.insert(places.end(), who)) {}
  ~Place() { places_.erase(where_); }
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;

 private:
  Parts::Places& places_;
  const Parts::Places::iterator where_;
};

/// A client that has become a WebSocket.
class ViewerConnection : public Connection, public std::enable_shared_from_this<ViewerConnection> {
 public:
  ViewerConnection(std::shared_ptr<Parts> parts, beast::tcp_stream&& stream, const Request& request)
      : parts_(std::move(parts)),
        socket_(std::move(stream)),
        viewer_(parts_->WhyNotArm(request), [this] { Send(); }) {
    address = AddressOf(beast::get_lowest_layer(socket_).socket());
  }
  ~ViewerConnection() override { Leave(); }

  void Begin(Request request) {
    place_.emplace(parts_->viewers, shared_from_this());
    beast::get_lowest_layer(socket_).expires_never();
    error_code ignored;
    beast::get_lowest_layer(socket_).socket().set_option(tcp::no_delay(true), ignored);
    websocket::stream_base::timeout timeout{kRequestTime, kSilence, true};
    socket_.set_option(timeout);
    socket_.read_message_max(kMaxClientMessage);
    socket_.auto_fragment(false);
    socket_.set_option(websocket::stream_base::decorator([](websocket::response_type& response) {
      response.set(http::field::sec_websocket_protocol, kFoxgloveProtocol);
    }));
    request_ = std::move(request);
    socket_.async_accept(request_, [self = shared_from_this()](error_code error) {
      if (!error) self->Join();
    });
  }

  void Close() override {
    Leave();
    place_.reset();
    beast::get_lowest_layer(socket_).close();
  }
  bool sending() const override { return sending_.has_value() || !viewer_.outbox.empty(); }

 private:
  void Leave() {
    if (std::exchange(joined_, false)) parts_->gateway.Leave(viewer_);
  }

  void Join() {
    if (parts_->ended) return;
    joined_ = true;
    socket_.binary(true);
    parts_->gateway.Join(viewer_);
    Read();
  }

  void Read() {
    socket_.async_read(buffer_, [self = shared_from_this()](error_code error, size_t) {
      if (error || self->parts_->ended) return self->Close();
      self->Take();
      self->buffer_.consume(self->buffer_.size());
      self->Read();
    });
  }

  void Take() {
    const auto data = buffer_.data();
    const std::span<const uint8_t> bytes(static_cast<const uint8_t*>(data.data()), data.size());
    if (socket_.got_text()) {
      parts_->gateway.OnText(viewer_, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    } else {
      parts_->gateway.OnBinary(viewer_, bytes, parts_->setting.moment());
    }
  }

  /// One at a time: what waits longer, waits in the outbox, which has a bound.
  void Send() {
    if (viewer_.outbox.hopeless())  // whoever has just put something in is still at it
      return asio::post(parts_->context, [self = shared_from_this()] { self->Close(); });
    if (sending_ || viewer_.outbox.empty()) return;
    sending_ = viewer_.outbox.Pop();
    socket_.binary(sending_->binary);
    const std::array<asio::const_buffer, 2> buffers{
        sending_->head ? asio::buffer(*sending_->head) : asio::const_buffer(),
        asio::buffer(*sending_->payload)};
    socket_.async_write(buffers, [self = shared_from_this()](error_code error, size_t) {
      self->sending_.reset();
      if (error) return self->Close();
      self->Send();
    });
  }

  const std::shared_ptr<Parts> parts_;
  websocket::stream<beast::tcp_stream, false> socket_;
  beast::flat_buffer buffer_;
  Request request_;
  Viewer viewer_;
  std::optional<Place> place_;
  std::optional<Outbox::Item> sending_;
  bool joined_ = false;
};

/// A client that asks for files, one after the other.
class RequestConnection : public Connection,
                          public std::enable_shared_from_this<RequestConnection> {
 public:
  RequestConnection(std::shared_ptr<Parts> parts, tcp::socket&& socket)
      : parts_(std::move(parts)), stream_(std::move(socket)) {}

  void Begin() {
    place_.emplace(parts_->requests, shared_from_this());
    Read();
  }
  void Close() override {
    place_.reset();
    stream_.close();
  }

 private:
  void Read() {
    parser_.emplace();
    parser_->header_limit(kMaxHeader);
    parser_->body_limit(0);
    stream_.expires_after(kRequestTime);
    http::async_read(stream_, buffer_, *parser_,
                     [self = shared_from_this()](error_code error, size_t) {
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
    Respond(Text(http::status::bad_request, "no request that can be read: " + error.message()),
            false);
  }

  void OnRequest() {
    request_ = parser_->release();
    const std::string_view host = View(request_[http::field::host]);
    const Access& access = parts_->setting.access;
    if (!access.HostAllowed(host))
      return Respond(Text(http::status::forbidden,
                          "this is not a name of ours: open it by its number, or give --host"));
    if (websocket::is_upgrade(request_)) return Upgrade(host);
    if (request_.method() != http::verb::get && request_.method() != http::verb::head)
      return Respond(Text(http::status::method_not_allowed, "GET and HEAD only"));
    const std::string_view target = View(request_.target());
    const size_t query = std::min(target.find('?'), target.size());
    Answer(target.substr(0, query), target.substr(std::min(query + 1, target.size())));
  }

  void Answer(std::string_view path, std::string_view query) {
    constexpr std::string_view kToken = "token=";
    if (path == "/" && query.starts_with(kToken)) return TakeToken(query.substr(kToken.size()));
    if (path == "/robot.json") {
      Response response =
          Text(http::status::ok, RobotJson(parts_->robot, parts_->WhyNotArm(request_)));
      response.set(http::field::content_type, "application/json");
      return Respond(std::move(response));
    }
    auto file = parts_->page.Find(
        path, http::ext_list(request_[http::field::accept_encoding]).exists("gzip"));
    if (!file) return Respond(Text(http::status::not_found, "there is no such file"));
    Response response = Text(http::status::ok, std::move(file->content));
    response.set(http::field::content_type, file->type);
    response.set(http::field::vary, "Accept-Encoding");
    if (file->gzipped) response.set(http::field::content_encoding, "gzip");
    Respond(std::move(response));
  }

  /// The token moves from the address, which stands in histories and pictures of screens, to a
  /// cookie.
  void TakeToken(std::string_view token) {
    if (parts_->setting.access.token.empty() || !parts_->setting.access.IsToken(token))
      return Respond(Text(http::status::forbidden, "this token is not, or no longer, right"));
    Response response = Text(http::status::see_other, "");
    response.set(http::field::location, "/");
    response.set(http::field::set_cookie,
                 fmt::format("{}={}; HttpOnly; SameSite=Strict; Path=/", kTokenCookie, token));
    Respond(std::move(response));
  }

  void Upgrade(std::string_view host) {
    const Access& access = parts_->setting.access;
    auto offered = http::token_list(request_[http::field::sec_websocket_protocol]);
    if (!access.OriginAllowed(View(request_[http::field::origin]), host))
      return Respond(Text(http::status::forbidden, "another page may not talk to us: --origin"));
    if (!offered.exists(kFoxgloveProtocol))
      return Respond(
          Text(http::status::bad_request, fmt::format("the subprotocol is {}", kFoxgloveProtocol)));
    parts_->MakeRoomForViewer();
    stream_.expires_never();
    std::make_shared<ViewerConnection>(parts_, std::move(stream_), request_)->Begin(request_);
  }

  static Response Text(http::status status, std::string text) {
    Response response(status, 11);
    response.set(http::field::content_type, "text/plain; charset=utf-8");
    response.body() = std::move(text);
    return response;
  }

  /// Whatever the page is led to believe: nothing but itself runs in it, it is in no frame of
  /// another, and asks nobody else for anything.
  void Respond(Response response, bool keep_alive = true) {
    const std::string host(View(request_[http::field::host]));
    const bool named = parts_->setting.access.HostAllowed(host);
    response.set("Content-Security-Policy",
                 fmt::format("default-src 'self'; connect-src 'self'{}; frame-ancestors 'none'; "
                             "base-uri 'none'; form-action 'none'",
                             named ? " ws://" + host : ""));
    response.set("X-Content-Type-Options", "nosniff");
    response.set("X-Frame-Options", "DENY");
    response.set("Referrer-Policy", "no-referrer");
    response.set("Cross-Origin-Resource-Policy", "same-origin");
    response.set("Cross-Origin-Opener-Policy", "same-origin");
    response.set(http::field::cache_control, "no-cache");
    response.keep_alive(keep_alive && request_.keep_alive());
    response.prepare_payload();
    if (request_.method() == http::verb::head) response.body().clear();
    response_ = std::move(response);
    stream_.expires_after(kResponseTime);
    http::async_write(stream_, response_, [self = shared_from_this()](error_code error, size_t) {
      if (error || !self->response_.keep_alive() || self->parts_->ended) return self->Close();
      self->Read();
    });
  }

  const std::shared_ptr<Parts> parts_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{kMaxHeader + 4096};
  std::optional<http::request_parser<http::empty_body>> parser_;
  Request request_;
  Response response_;
  std::optional<Place> place_;
};

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
    std::make_shared<RequestConnection>(parts, std::move(socket))->Begin();
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
