#include "drivers/driver/state_log.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "plumb/driver_status_t.hpp"

namespace plumb {
namespace {

TEST_CASE("changes of state are logged once, and never by waiting for a reader") {
  int ends[2];
  REQUIRE(pipe2(ends, O_CLOEXEC | O_NONBLOCK) == 0);
  std::vector<std::string> lines;
  StateLog log(
      ends[1],
      [&](int8_t state, std::string_view reason) {
        lines.push_back(std::to_string(state) + " " + std::string(reason));
      },
      [&](int64_t changes) { lines.push_back(std::to_string(changes) + " lost"); });
  log.Note(driver_status_t::IDLE, "waiting");
  log.Note(driver_status_t::IDLE, "waiting");
  CHECK(lines.empty());
  log.Drain();
  CHECK(lines == std::vector<std::string>{"1 waiting"});
  log.Note(driver_status_t::IDLE, "waiting");
  log.Drain();
  CHECK(lines.size() == 1);

  // Nobody reads the pipe.
  const std::array<char, 4096> page{};
  while (write(ends[1], page.data(), page.size()) > 0) {
  }
  CHECK_FALSE(log.ready());
  for (int i = 0; i < 20; ++i) log.Note(driver_status_t::FAULT, "fault " + std::to_string(i));
  log.Drain();
  CHECK(lines.size() == 1);

  std::array<char, 1 << 16> read_back;
  while (read(ends[0], read_back.data(), read_back.size()) > 0) {
  }
  log.Drain();
  REQUIRE(lines.size() == 18);
  CHECK(lines[1] == "4 lost");
  CHECK(lines[2] == "4 fault 4");
  CHECK(lines.back() == "4 fault 19");
  close(ends[0]);
  close(ends[1]);
}

}  // namespace
}  // namespace plumb
