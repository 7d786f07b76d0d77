#include "http/client.h"

#include <fmt/format.h>

#include <boost/asio/io_context.hpp>
#include <charconv>
#include <chrono>
#include <future>
#include <stdexcept>
#include <thread>
#include <utility>

#include "common/listen_address.h"
#include "http/http.h"

namespace plumb {
namespace {

using std::chrono::steady_clock;

constexpr auto kResolveTime = std::chrono::seconds(10), kConnectTime = std::chrono::seconds(10),
               kAnswerTime = std::chrono::seconds(600);
constexpr auto kLookTime = std::chrono::milliseconds(100);  // between two calls of `look`

struct Place {
  std::string authority;  // host and port as they are written, which a request repeats
  std::string host, port;
};

Place Parse(const std::string& server) {
  constexpr std::string_view kScheme = "http://";
  std::string authority = server.starts_with(kScheme) ? server.substr(kScheme.size()) : "";
  if (authority.ends_with('/')) authority.pop_back();
  const HostAndPort parts = HostAndPort::Split(authority);
  const std::string port(parts.port.empty() ? "80" : parts.port);
  uint16_t number = 0;
  const char* const end = port.data() + port.size();
  const auto [last, error] = std::from_chars(port.data(), end, number);
  if (parts.host.empty() || parts.host.find_first_of("/?#@[] ") != std::string::npos ||
      error != std::errc() || last != end) {
    throw std::invalid_argument(server + ": not of the form http://HOST:PORT");
  }
  return {std::move(authority), parts.host, port};
}

/// In a thread of its own, as nothing ends the system's search before it has found something or
/// given up.
tcp::resolver::results_type Resolve(const Place& place, const std::function<void()>& look) {
  std::packaged_task<tcp::resolver::results_type()> search([place] {
    asio::io_context context;
    return tcp::resolver(context).resolve(place.host, place.port);
  });
  std::future<tcp::resolver::results_type> found = search.get_future();
  std::thread(std::move(search)).detach();
  const auto end = steady_clock::now() + kResolveTime;
  while (found.wait_for(kLookTime) != std::future_status::ready) {
    look();
    if (steady_clock::now() > end)
      throw boost::system::system_error(asio::error::host_not_found_try_again);
  }
  return found.get();
}

/// Runs one operation to its end; beast's time-outs are those of operations in a context.
template <class Start>
void Complete(asio::io_context& context, const std::function<void()>& look, const Start& start) {
  error_code failed;
  start([&failed](error_code error, const auto&) { failed = error; });
  context.restart();
  while (context.run_for(kLookTime), !context.stopped()) look();
  if (failed) throw boost::system::system_error(failed);
}

}  // namespace

HttpAnswer PostHttp(const std::string& server, const std::string& path, std::string body,
                    size_t longest_answer, const std::function<void()>& look) {
  const Place place = Parse(server);
  Request request(http::verb::post, path, 11);
  request.set(http::field::host, place.authority);
  request.set(http::field::content_type, "application/json");
  request.keep_alive(false);
  request.body() = std::move(body);
  request.prepare_payload();
  beast::flat_buffer buffer;
  http::response_parser<http::string_body> parser;
  parser.body_limit(longest_answer);
  try {
    // What `look` interrupts goes with the context, before all that it knows.
    asio::io_context context;
    beast::tcp_stream stream(context);
    const auto endpoints = Resolve(place, look);
    stream.expires_after(kConnectTime);
    Complete(context, look, [&](auto done) { stream.async_connect(endpoints, done); });
    stream.expires_after(kAnswerTime);
    Complete(context, look, [&](auto done) { http::async_write(stream, request, done); });
    Complete(context, look,
             [&](auto done) { http::async_read_header(stream, buffer, parser, done); });
    // Of responses, Beast's own limit is for bodies of unknown length.
    if (parser.content_length().value_or(0) > longest_answer)
      throw boost::system::system_error(http::make_error_code(http::error::body_limit));
    Complete(context, look, [&](auto done) { http::async_read(stream, buffer, parser, done); });
  } catch (const boost::system::system_error& error) {
    throw std::runtime_error(fmt::format("{}{}: {}", server, path, error.code().message()));
  }
  return {static_cast<int>(parser.get().result_int()), std::move(parser.get().body())};
}

}  // namespace plumb
