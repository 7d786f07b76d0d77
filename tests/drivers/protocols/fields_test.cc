#include "drivers/protocols/fields.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <string>

#include "common/special_numbers.h"

namespace plumb {
namespace {

using Kind = Field::Kind;
using Order = Field::Order;

std::string Text(const Layout& layout, std::initializer_list<double> values) {
  Frame frame;
  EncodePayload(layout, values, frame);
  return ToText(frame);
}

// All of it can be done at compile time.
constexpr Field kBig{"x", 12, 12, Kind::kUnsigned, 1, "", Order::kBigEndian};
static_assert(kBig.Encode(0xABC) == 0xBC0A00);  // bytes 00 0A BC
static_assert(kBig.Decode(0xBC0A00) == 0xABC);
constexpr Field kRange = RangeField("t", 52, 12, -18, 18, "Nm");
static_assert(kRange.Decode(kRange.Encode(18)) > 17.999999 && kRange.Holds(18) &&
              !kRange.Holds(18.1));
static_assert(Layout{0, "", 8, {{kBig, kRange}}}.needed() == 8);

TEST_CASE("big-endian fields: bytes written by hand") {
  constexpr auto field = [](int bit, int bits, Kind kind, double scale = 1) {
    return Field{"x", static_cast<uint8_t>(bit), static_cast<uint8_t>(bits), kind, scale,
                 "",  Order::kBigEndian};
  };
  CHECK(Text({0, "", 2, {{field(0, 16, Kind::kUnsigned)}}}, {0x1234}) == "000#1234");
  CHECK(Text({0, "", 3, {{field(8, 16, Kind::kUnsigned)}}}, {0x1234}) == "000#001234");
  CHECK(Text({0, "", 3, {{field(12, 12, Kind::kUnsigned)}}}, {0xABC}) == "000#000ABC");
  CHECK(Text({0, "", 4, {{field(0, 32, Kind::kUnsigned)}}}, {123456}) == "000#0001E240");
  CHECK(Text({0, "", 1, {{field(3, 2, Kind::kUnsigned)}}}, {3}) == "000#18");
  CHECK(Text({0, "", 8, {{field(16, 48, Kind::kUnsigned)}}}, {0x010203040506}) ==
        "000#0000010203040506");
  CHECK(Text({0, "", 2, {{field(0, 16, Kind::kSigned, 1. / 256)}}}, {-48.996}) == "000#CF01");
  CHECK(Text({0, "", 2, {{field(0, 16, Kind::kSigned)}}}, {-1}) == "000#FFFF");
  CHECK(Text({0, "", 4, {{field(0, 32, Kind::kFloat)}}}, {1.5}) == "000#3FC00000");
  // Neighbours do not touch.
  CHECK(Text({0, "", 3, {{field(0, 12, Kind::kUnsigned), field(12, 12, Kind::kUnsigned)}}},
             {0x123, 0x456}) == "000#123456");
}

TEST_CASE("a field covers the same bytes in either order, and leaves others alone") {
  for (const Order order : {Order::kLittleEndian, Order::kBigEndian}) {
    for (const Kind kind : {Kind::kUnsigned, Kind::kSigned}) {
      for (int bits = 1; bits <= 48; ++bits) {
        for (int bit = 0; bit + bits <= 64; ++bit) {
          const Field field{
              "x", static_cast<uint8_t>(bit), static_cast<uint8_t>(bits), kind, 1, "", order};
          const uint64_t all =
              kind == Kind::kSigned ? field.Encode(-1) : field.Encode(field.highest());
          if (std::popcount(all) != bits) FAIL(bit << " " << bits);
          for (const double value : {field.lowest(), field.highest(), 0.0}) {
            if (field.Decode(field.Encode(value)) != value)
              FAIL(bit << " " << bits << " " << value);
            if (field.Decode(field.Encode(value) | ~all) != value)
              FAIL(bit << " " << bits << " " << value);
          }
          const size_t needed = Layout{0, "", 8, {{field}}}.needed();
          if (needed < 8 && all >> (8 * needed) != 0) FAIL(bit << " " << bits);
          if ((all >> (8 * (needed - 1)) & 0xFF) == 0) FAIL(bit << " " << bits);
        }
      }
    }
  }
}

TEST_CASE("every code of a range survives decoding and encoding") {
  for (const double most : {12.5, 95.5, 45.0, 22.5, 76.0, 25.64, 50.0, 65.0, 18.0, 0.1, 1e6}) {
    for (const int bits : {8, 12, 16}) {
      for (const double least : {-most, 0.0}) {
        const Field field = RangeField("x", 0, bits, least, most);
        for (uint64_t code = 0; code <= field.mask(); ++code) {
          Frame frame;
          EncodePayload({0, "", 2, {{field}}},
                        {least + (most - least) * double(code) / double(field.mask())}, frame);
          const uint64_t got = (uint64_t{frame.data[0]} << 8 | frame.data[1]) >> (16 - bits);
          const uint64_t payload = uint64_t{frame.data[0]} | uint64_t{frame.data[1]} << 8;
          if (got != code || field.Encode(field.Decode(payload)) != payload)
            FAIL(most << " " << code);
        }
        CHECK(field.Decode(field.Encode(most)) == Approx(most).epsilon(1e-14));
        CHECK(field.lowest() == least);
        CHECK(field.highest() == Approx(most).epsilon(1e-14));
        CHECK(field.Encode(2 * most) == field.Encode(most));
        CHECK(field.Encode(least - 1) == field.Encode(least));
        // Nonsense is not the least of the range, which would be a great torque backwards.
        CHECK(field.Encode(kNaN) == field.Encode(0));
        CHECK(std::abs(field.Decode(field.Encode(kNaN))) <= 0.5001 * field.scale);
      }
    }
  }
}

TEST_CASE("what a field holds") {
  constexpr Field i16{"x", 0, 16, Kind::kSigned, 0.001, ""};
  CHECK(i16.Holds(-32.768));
  CHECK_FALSE(i16.Holds(-32.77));
  CHECK(i16.Holds(32.767));
  CHECK_FALSE(i16.Holds(32.768));
  CHECK_FALSE(i16.Holds(kNaN));
  constexpr Field f{"x", 0, 32, Kind::kFloat};
  CHECK(f.Holds(-3e38));
  CHECK_FALSE(f.Holds(std::numeric_limits<double>::infinity()));
  CHECK_FALSE(f.Holds(kNaN));
}

TEST_CASE("scale and offset, signed and float, too") {
  constexpr Field temperature{"x", 0, 8, Kind::kUnsigned, 0.5, "degC", Order::kLittleEndian, -40};
  CHECK(temperature.Encode(-40) == 0);
  CHECK(temperature.Encode(25) == 130);
  CHECK(temperature.Decode(130) == 25);
  constexpr Field shifted{"x", 0, 8, Kind::kSigned, 2, "", Order::kLittleEndian, 10};
  CHECK(shifted.Decode(shifted.Encode(-30)) == -30);
  constexpr Field f{"x", 0, 32, Kind::kFloat, 2, "", Order::kLittleEndian, 1};
  CHECK(f.Decode(f.Encode(4)) == 4);
}

}  // namespace
}  // namespace plumb
