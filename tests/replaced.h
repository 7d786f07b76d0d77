#pragma once

#include <catch2/catch.hpp>
#include <string>

namespace plumb {

/// A text in which `from`, which it has, is `to` where it comes first.
inline std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  INFO(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

}  // namespace plumb
