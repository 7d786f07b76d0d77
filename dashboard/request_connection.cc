#include "dashboard/request_connection.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/beast/websocket/rfc6455.hpp>
#include <optional>
#include <utility>

#include "dashboard/foxglove.h"
#include "dashboard/robot_json.h"
#include "dashboard/viewer_connection.h"

namespace plumb {
namespace {

using Parts = Server::Parts;

constexpr auto kResponseTime = std::chrono::seconds(30);  // for whoever reads slowly
constexpr size_t kMaxHeader = 8 << 10;                    // [bytes]

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
    if (beast::websocket::is_upgrade(request_)) return Upgrade(host);
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
    BeginViewer(parts_, std::move(stream_), request_);
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

}  // namespace

void BeginRequests(std::shared_ptr<Parts> parts, tcp::socket&& socket) {
  std::make_shared<RequestConnection>(std::move(parts), std::move(socket))->Begin();
}

}  // namespace plumb
