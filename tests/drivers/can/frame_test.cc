#include "drivers/can/frame.h"

#include <catch2/catch.hpp>

namespace plumb {
namespace {

TEST_CASE("frames are written and read as candump does") {
  // Each text is what candump -L or cansend calls the frame.
  const auto text = GENERATE(as<std::string>{}, "02E#0000C03F00000000", "029#R", "029#R8", "022#",
                             "7FF#00", "1ABCDEF0#0001020304050607", "00000029#11", "124##1112233",
                             "20000040#0000000000000000");
  INFO(text);
  const auto frame = FrameFromText(text);
  REQUIRE(frame);
  CHECK(ToText(*frame) == text);
}

TEST_CASE("the parts of a frame's text") {
  const auto torque = FrameFromText("02E#0000C03F");
  REQUIRE(torque);
  CHECK(torque->id == 0x2E);
  CHECK(torque->length == 4);
  CHECK(torque->data[2] == 0xC0);
  CHECK_FALSE((torque->extended || torque->remote || torque->error || torque->fd));

  const auto request = FrameFromText("029#R8");
  REQUIRE(request);
  CHECK(request->remote);
  CHECK(request->length == 8);
  CHECK(request->payload().empty());

  const auto extended = FrameFromText("00000029#11");
  REQUIRE(extended);
  CHECK(extended->extended);
  CHECK(extended->id == 0x29);

  const auto fd = FrameFromText("124##1000102030405060708090A0B");
  REQUIRE(fd);
  CHECK(fd->fd);
  CHECK(fd->bit_rate_switch);
  CHECK_FALSE(fd->error_state_indicator);
  CHECK(fd->length == 12);

  const auto from_candump = FrameFromText("124##5112233");
  REQUIRE(from_candump);
  CHECK(ToText(*from_candump) == "124##1112233");

  const auto bus_off = FrameFromText("20000040#0000000000000000");
  REQUIRE(bus_off);
  CHECK(bus_off->error);
  CHECK(bus_off->id == 0x40);
}

TEST_CASE("texts that are no frame") {
  const auto text =
      GENERATE(as<std::string>{}, "", "#", "02E", "2E#00", "02E#0", "02E#000000000000000000",
               "02G#00", "02E#0G", "800#00", "3FFFFFFF1#", "029#R9", "029#RR", "029#R88", "124##",
               "124##8", "124##11122334455667788AA", "02E#00 ", "-2E#00");
  INFO(text);
  CHECK_FALSE(FrameFromText(text));
}

TEST_CASE("equality on the wire ignores what is not sent") {
  Frame a = *FrameFromText("02E#0102");
  Frame b = a;
  b.receive_ns = 5;
  b.data[7] = 9;
  CHECK(SameOnWire(a, b));
  b.data[1] = 3;
  CHECK_FALSE(SameOnWire(a, b));
  CHECK_FALSE(SameOnWire(*FrameFromText("029#R"), *FrameFromText("029#")));
}

TEST_CASE("a batch refuses what it has no room for") {
  FrameBatch batch;
  for (size_t i = 0; i < FrameBatch::kCapacity; ++i) REQUIRE(batch.Push(Frame{}));
  CHECK_FALSE(batch.Push(Frame{}));
  CHECK(batch.size() == FrameBatch::kCapacity);
  batch.Clear();
  CHECK(batch.frames().empty());
}

}  // namespace
}  // namespace plumb
