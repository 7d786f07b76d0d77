#include "http/client.h"

#include <fmt/format.h>

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <stdexcept>
#include <utility>

#include "http/http.h"

namespace plumb {
namespace {

constexpr auto kConnectTime = std::chrono::seconds(10), kAnswerTime = std::chrono::seconds(600);

struct Place {
  std::string host, port;
};

Place Parse(const std::string& server) {
  constexpr std::string_view kScheme = "http://";
  std::string rest = server.starts_with(kScheme) ? server.substr(kScheme.size()) : "";
  if (rest.ends_with('/')) rest.pop_back();
  const size_t bracket = rest.find(']'), colon = rest.rfind(':');
  const bool has_port =
      colon != std::string::npos && (bracket == std::string::npos || colon > bracket);
  Place place{rest.substr(0, has_port ? colon : rest.size()),
              has_port ? rest.substr(colon + 1) : "80"};
  if (place.host.starts_with('[') && place.host.ends_with(']'))
    place.host = place.host.substr(1, place.host.size() - 2);
  if (place.host.empty() || place.host.find_first_of("/?#@ ") != std::string::npos ||
      place.port.empty() || place.port.find_first_not_of("0123456789") != std::string::npos) {
    throw std::invalid_argument(server + ": not of the form http://HOST:PORT");
  }
  return place;
}

/// Runs one operation to its end; beast's time-outs are those of operations in a context.
template <class Start>
void Complete(asio::io_context& context, const Start& start) {
  error_code failed;
  start([&failed](error_code error, const auto&) { failed = error; });
  context.restart();
  context.run();
  if (failed) throw boost::system::system_error(failed);
}

}  // namespace

HttpAnswer PostHttp(const std::string& server, const std::string& path, std::string body,
                    size_t longest_answer) {
  const Place place = Parse(server);
  try {
    asio::io_context context;
    beast::tcp_stream stream(context);
    const auto endpoints = tcp::resolver(context).resolve(place.host, place.port);
    stream.expires_after(kConnectTime);
    Complete(context, [&](auto done) { stream.async_connect(endpoints, done); });
    Request request(http::verb::post, path, 11);
    request.set(http::field::host, place.host);
    request.set(http::field::content_type, "application/json");
    request.keep_alive(false);
    request.body() = std::move(body);
    request.prepare_payload();
    stream.expires_after(kAnswerTime);
    Complete(context, [&](auto done) { http::async_write(stream, request, done); });
    beast::flat_buffer buffer;
    http::response_parser<http::string_body> parser;
    parser.body_limit(longest_answer);
    Complete(context, [&](auto done) { http::async_read_header(stream, buffer, parser, done); });
    // Of responses, Beast's own limit is for bodies of unknown length.
    if (parser.content_length().value_or(0) > longest_answer)
      throw boost::system::system_error(http::make_error_code(http::error::body_limit));
    Complete(context, [&](auto done) { http::async_read(stream, buffer, parser, done); });
    return {static_cast<int>(parser.get().result_int()), std::move(parser.get().body())};
  } catch (const boost::system::system_error& error) {
    throw std::runtime_error(fmt::format("{}{}: {}", server, path, error.code().message()));
  }
}

}  // namespace plumb
