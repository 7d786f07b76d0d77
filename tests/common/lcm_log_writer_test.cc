#include "common/lcm_log_writer.h"

#include <array>
#include <catch2/catch.hpp>
#include <cstdint>

namespace plumb {
namespace {

TEST_CASE("a log that finds no room says so, at the latest when it is complete") {
  // A device on which there is never any.
  LcmLogWriter log("/dev/full");
  const std::array<uint8_t, 100> message{};
  log.Write(1, "POLICY", message);  // waits for more
  CHECK_THROWS_WITH(log.Flush(), "/dev/full: cannot be written: No space left on device");
  CHECK_THROWS_WITH(
      [&] {
        for (int i = 0; i < 1000; ++i) log.Write(1, "POLICY", message);
      }(),
      "/dev/full: cannot be written: No space left on device");
}

}  // namespace
}  // namespace plumb
