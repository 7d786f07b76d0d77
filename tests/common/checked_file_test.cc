#include "common/checked_file.h"

#include <catch2/catch.hpp>

namespace plumb {
namespace {

constexpr FileKind kKind{"PLUMBABC", 3, "a thing"};

std::string WhatIsWrong(std::string_view bytes) {
  try {
    return "content: " + std::string(CheckedContent(kKind, bytes));
  } catch (const DamagedFile& error) {
    return error.what();
  }
}

TEST_CASE("what has a checksum is read again, and every changed bit is told") {
  const std::string bytes = WithChecksum(kKind, "123456789");
  CHECK(WhatIsWrong(bytes) == "content: 123456789");
  CHECK(bytes.substr(12, 4) == "\x26\x39\xf4\xcb");  // CRC-32's check value, 0xcbf43926
  for (size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    std::string damaged = bytes;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << bit % 8));
    const std::string wrong = WhatIsWrong(damaged);
    CHECK((bit < 64   ? wrong == "is not a thing"
           : bit < 96 ? wrong.starts_with("has version ")
                      : wrong == "is damaged"));
  }
  for (size_t size = 0; size < bytes.size(); ++size)
    CHECK(WhatIsWrong(bytes.substr(0, size)) == (size < 16 ? "is not a thing" : "is damaged"));
  CHECK(WhatIsWrong(bytes + "0") == "is damaged");
}

}  // namespace
}  // namespace plumb
