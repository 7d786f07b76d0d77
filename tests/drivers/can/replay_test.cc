#include "drivers/can/replay.h"

#include <poll.h>
#include <array>
#include <catch2/catch.hpp>
#include <fstream>
#include <string>
#include <vector>

#include "drivers/can/candump.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

using Catch::Matchers::Contains;
using Texts = std::vector<std::string>;

/// A log that is removed in the end.
class Log {
 public:
  explicit Log(const std::string& text) { std::ofstream(path()) << text; }
  std::string url() const { return "replay:" + path(); }
  std::string path() const { return folder_ / "bus.log"; }

 private:
  TemporaryFolder folder_;
};

Texts ReceiveAll(Transport& transport) {
  Texts texts;
  std::array<Frame, 2> frames;
  while (const int count = transport.Receive(frames)) {
    for (int i = 0; i < count; ++i) texts.push_back(ToText(frames[static_cast<size_t>(i)]));
    REQUIRE(texts.size() < 1000);
  }
  return texts;
}

bool Readable(const Transport& transport) {
  pollfd polled{transport.fd(), POLLIN, 0};
  return poll(&polled, 1, 0) == 1;
}

constexpr char kLog[] =
    "(1700000000.000000) can0 029#000080BE00006040\n"
    "(1700000000.002000) can0 029#R8\n"
    "(1700000000.002500) can0 1ABCDEF0#0011\n"
    "\n"
    "(1700000000.003000) can0 124##1000102030405060708090A0B\n"
    "(1700000000.001000) can0 022#\r\n"
    "(1700000000.010000) can0 20000040#0000000000000000\n";
const Texts kFrames = {"029#000080BE00006040",           "029#R8", "1ABCDEF0#0011",
                       "124##1000102030405060708090A0B", "022#",   "20000040#0000000000000000"};

TEST_CASE("without a time a log comes at once") {
  const Log log(kLog);
  const auto replay = OpenTransport(log.url());
  CHECK(replay->is_replay());
  CHECK(replay->warnings().empty());
  CHECK(Readable(*replay));
  CHECK(ReceiveAll(*replay) == kFrames);
  CHECK_FALSE(Readable(*replay));
  CHECK(replay->NextEvent() == Transport::kNever);
  CHECK(replay->stats().received == 6);
  CHECK(replay->stats().malformed == 0);
}

TEST_CASE("with a time it comes in its own, stamped as it was") {
  const Log log(kLog);
  const auto replay = OpenTransport(log.url());
  replay->SetTime(5'000'000);
  CHECK(Readable(*replay));
  std::array<Frame, 4> frames;
  REQUIRE(replay->Receive(frames) == 1);
  CHECK(frames[0].receive_ns == 1'700'000'000'000'000'000);
  CHECK_FALSE(Readable(*replay));
  CHECK(replay->NextEvent() == 5'002'000);
  replay->SetTime(5'001'999);
  CHECK(replay->Receive(frames) == 0);
  replay->SetTime(5'002'500);
  CHECK(Readable(*replay));
  CHECK(ReceiveAll(*replay) == Texts{"029#R8", "1ABCDEF0#0011"});
  replay->SetTime(4'000'000);  // does not go back
  CHECK(replay->NextEvent() == 5'003'000);
  replay->SetTime(5'003'000);
  // The log went back in time: that frame comes with the one before it.
  REQUIRE(replay->Receive(frames) == 2);
  CHECK(ToText(frames[1]) == "022#");
  CHECK(frames[1].receive_ns == 1'700'000'000'001'000'000);
  replay->SetTime(6'000'000);
  CHECK(ReceiveAll(*replay) == Texts{"20000040#0000000000000000"});
}

TEST_CASE("filters hold for a log, and our own frames in it are echoes") {
  const Log log(
      "(1.0) can0 029#11\n(1.1) can0 02E#22\n(1.2) can0 029#R\n(1.3) can0 049#33\n(1.4) can0 "
      "00000029#44\n");
  const auto replay =
      OpenTransport(log.url(), {{.id = 0x20, .mask = 0x7E0}, {.id = 0x2E, .own = true}});
  CHECK(ReceiveAll(*replay) == Texts{"029#11"});
  CHECK(replay->stats().echoes == 1);
  CHECK(replay->stats().foreign == 0);
}

TEST_CASE("what is sent to a log is counted and goes nowhere") {
  const Log log(kLog);
  const auto replay = OpenTransport(log.url());
  const std::array<Frame, 2> frames = {*FrameFromText("02E#00"), *FrameFromText("02E#01")};
  CHECK(replay->Send(frames) == 2);
  CHECK(replay->stats().sent == 2);
  CHECK(ReceiveAll(*replay) == kFrames);
}

TEST_CASE("lines that are no frames are counted and named") {
  std::string text = std::string(kLog) + "half a lin";
  {
    const Log log(text);
    const auto replay = OpenTransport(log.url());
    REQUIRE(replay->warnings().size() == 1);
    CHECK(replay->warnings()[0] == log.path() + ":8: not a line of candump -l: 'half a lin'");
    CHECK(replay->stats().malformed == 1);
    CHECK(ReceiveAll(*replay) == kFrames);
  }
  for (int i = 0; i < 20; ++i) text += "\n" + std::string(200, 'x');
  text += "\n(1.0) vcan7 029#\n";
  const Log log(text);
  const auto replay = OpenTransport(log.url());
  CHECK(replay->stats().malformed == 21);
  REQUIRE(replay->warnings().size() == 7);
  CHECK_THAT(replay->warnings()[5], Contains("21 lines in all"));
  CHECK_THAT(replay->warnings()[6], Contains("2 interfaces") && Contains("grep ' can0 '"));
  for (const std::string& warning : replay->warnings()) CHECK(warning.size() < 200);
}

TEST_CASE("logs that are none") {
  CHECK_THROWS_WITH(OpenTransport("replay:/nonexistent.log"), Contains("cannot be read"));
  CHECK_THROWS_WITH(OpenTransport("replay:"), Contains("cannot be read"));
  CHECK_THROWS_WITH(OpenTransport("replay:/"), Contains("no line of it is a frame"));
  const Log log("# nothing\n");
  CHECK_THROWS_WITH(OpenTransport(log.url()),
                    Contains("no line of it is a frame") && Contains("candump -l"));
}

TEST_CASE("a log behind faults is a log still") {
  const Log log(kLog);
  const auto replay = OpenTransport("faulty:loss=1:" + log.url());
  CHECK(replay->is_replay());
  replay->SetTime(0);
  replay->SetTime(1'000'000);
  CHECK(ReceiveAll(*replay).empty());
  CHECK(replay->stats().injected == 2);
}

TEST_CASE("lines of candump and python-can") {
  for (const char* line : {"(1700000000.263847) can0 02E#0000C03F00000000",
                           "(1700000000.263847) can0 02E#0000C03F00000000 R",
                           "(1700000000.263847)  can0  02E#0000C03F00000000 T\r",
                           "(1700000000.263847000) can0 02e#0000c03f00000000"}) {
    INFO(line);
    const auto logged = ParseCandump(line);
    REQUIRE(logged);
    CHECK(logged->time_ns == 1'700'000'000'263'847'000);
    CHECK(logged->frame.receive_ns == logged->time_ns);
    CHECK(logged->interface == "can0");
    CHECK(ToText(logged->frame) == "02E#0000C03F00000000");
  }
  for (const char* line : {"",
                           "(",
                           "()",
                           "(1.0)",
                           "(1.0) can0",
                           "1.0 can0 029#",
                           "(1) can0 029#",
                           "(1.) can0 029#",
                           "(.1) can0 029#",
                           "(-1.0) can0 029#",
                           "(1.-1) can0 029#",
                           "(+1.0) can0 029#",
                           "(9999999999.0) can0 029#",
                           "(99999999999999999999.0) can0 029#",
                           "(1.0000000001) can0 029#",
                           "(1.0 ) can0 029#",
                           "(nan.0) can0 029#",
                           "(1.0) can0 029",
                           "(1.0) can0 029#1",
                           "(1.0) can0 029#000102030405060708",
                           "(1.0) can0 829#",
                           "(1.0) can0 029# X",
                           "(1.0) can0 029# R R",
                           "(1.0) 029#"}) {
    INFO(line);
    CHECK_FALSE(ParseCandump(line));
  }
}

}  // namespace
}  // namespace plumb
