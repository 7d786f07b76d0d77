#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <string>
#include <string_view>

/// Boost.Beast under short names.
namespace plumb {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using boost::system::error_code;

using Request = http::request<http::string_body>;
using Response = http::response<http::string_body>;

inline std::string_view View(boost::string_view text) { return {text.data(), text.size()}; }

/// A response with that text. Thread-safe.
inline Response MakeResponse(http::status status, std::string_view type, std::string text) {
  Response response(status, 11);
  response.set(http::field::content_type, boost::string_view(type.data(), type.size()));
  response.body() = std::move(text);
  return response;
}

}  // namespace plumb
