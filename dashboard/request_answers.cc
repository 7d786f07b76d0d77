#include "dashboard/request_answers.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/beast/websocket/rfc6455.hpp>
#include <mutex>
#include <optional>
#include <utility>

#include "common/listen_address.h"
#include "common/outside_text.h"
#include "dashboard/foxglove.h"
#include "dashboard/robot_json.h"
#include "dashboard/viewer_connection.h"

namespace plumb {
namespace {

using Parts = Server::Parts;

Response Text(http::status status, std::string text) {
  return MakeResponse(status, "text/plain; charset=utf-8", std::move(text));
}

/// Whatever the page is led to believe: nothing but itself runs in it, it is in no frame of
/// another, and asks nobody else for anything.
/// @param host by which the page may talk to us; empty = by none.
Response Guarded(Response response, const std::string& host) {
  response.set("Content-Security-Policy",
               fmt::format("default-src 'self'; connect-src 'self'{}; frame-ancestors 'none'; "
                           "base-uri 'none'; form-action 'none'",
                           host.empty() ? "" : " ws://" + host));
  response.set("X-Content-Type-Options", "nosniff");
  response.set("X-Frame-Options", "DENY");
  response.set("Referrer-Policy", "no-referrer");
  response.set("Cross-Origin-Resource-Policy", "same-origin");
  response.set("Cross-Origin-Opener-Policy", "same-origin");
  response.set(http::field::cache_control, "no-cache");
  return response;
}

/// The token moves from the address, which stands in histories and pictures of screens, to a
/// cookie. @param host the header "Host".
Response TakeToken(const Access& access, std::string_view host, std::string_view token) {
  if (access.token.empty() || !access.IsToken(token))
    return Text(http::status::forbidden, "this token is not, or no longer, right");
  // A cookie is its host's, whatever the port: each dashboard of a machine gets its own.
  std::string name(kTokenCookie);
  for (const char c : HostAndPort::Split(host).port) {
    if ('0' <= c && c <= '9') name += c;
  }
  Response response = Text(http::status::see_other, "");
  response.set(http::field::location, "/");
  response.set(http::field::set_cookie,
               fmt::format("{}={}; HttpOnly; SameSite=Strict; Path=/", name, token));
  return response;
}

Response Find(const Parts& parts, const Request& request) {
  const std::string_view target = View(request.target());
  const size_t mark = std::min(target.find('?'), target.size());
  const std::string_view path = target.substr(0, mark),
                         query = target.substr(std::min(mark + 1, target.size()));
  constexpr std::string_view kToken = "token=";
  if (path == "/" && query.starts_with(kToken))
    return TakeToken(parts.setting.access, View(request[http::field::host]),
                     query.substr(kToken.size()));
  if (path == "/robot.json") {
    return MakeResponse(http::status::ok, "application/json",
                        RobotJson(parts.robot, parts.WhyNotArm(request)));
  }
  auto file =
      parts.page.Find(path, http::ext_list(request[http::field::accept_encoding]).exists("gzip"));
  if (!file) return Text(http::status::not_found, "there is no such file");
  Response response = MakeResponse(http::status::ok, file->type, std::move(file->content));
  response.set(http::field::vary, "Accept-Encoding");
  if (file->gzipped) response.set(http::field::content_encoding, "gzip");
  return response;
}

/// Why a request does not become a WebSocket; none: it does.
std::optional<Response> WhyNotUpgrade(const Access& access, const Request& request) {
  const std::string_view host = View(request[http::field::host]);
  const std::string_view origin = View(request[http::field::origin]);
  if (!access.OriginAllowed(origin, host)) {
    // Viewers show their users no more than that it failed. Once: any page may ask on and on.
    static std::once_flag said;
    std::call_once(said, [&] {
      spdlog::warn("a page of {0} was refused, as others will be: --origin {0} lets it in",
                   Printable(origin));
    });
    return Text(http::status::forbidden, "another page may not talk to us: --origin");
  }
  auto offered = http::token_list(request[http::field::sec_websocket_protocol]);
  if (!offered.exists(kFoxgloveProtocol)) {
    return Text(http::status::bad_request, fmt::format("the subprotocol is {}", kFoxgloveProtocol));
  }
  return {};
}

}  // namespace

Response AnswerRequest(const Parts& parts, const Request& request) {
  const Access& access = parts.setting.access;
  const std::string host(View(request[http::field::host]));
  if (!access.HostAllowed(host)) {
    return Guarded(Text(http::status::forbidden,
                        "this is not a name of ours: open it by its number, or give --host"),
                   "");
  }
  if (beast::websocket::is_upgrade(request)) {
    if (auto why = WhyNotUpgrade(access, request)) return Guarded(std::move(*why), host);
  }
  if (request.method() != http::verb::get && request.method() != http::verb::head)
    return Guarded(Text(http::status::method_not_allowed, "GET and HEAD only"), host);
  return Guarded(Find(parts, request), host);
}

Response RefuseRequest(const std::string& why) {
  return Guarded(Text(http::status::bad_request, why), "");
}

bool UpgradeRequest(const std::shared_ptr<Parts>& parts, const Request& request,
                    beast::tcp_stream& stream) {
  const Access& access = parts->setting.access;
  if (!access.HostAllowed(View(request[http::field::host])) || WhyNotUpgrade(access, request))
    return false;
  parts->MakeRoomForViewer();
  BeginViewer(parts, std::move(stream), request);
  return true;
}

}  // namespace plumb
