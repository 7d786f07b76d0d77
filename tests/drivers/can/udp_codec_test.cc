#include "drivers/can/udp_codec.h"

#include <array>
#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "common/random.h"

namespace plumb {
namespace {

struct Vector {
  const char* text;
  double timestamp;
  const char* datagram;
};
// Datagrams captured from Debian's python3-can 4.1.0.
const Vector kVectors[] = {
    {"02E#0000C03F00000000", 0,
     "8ba974696d657374616d70cb0000000000000000ae6172626974726174696f6e5f69642eae69735f657874656e646"
     "5645f6964c"
     "2af6973"
     "5f72656d6f74655f6672616d65c2ae69735f6572726f725f6672616d65c2a76368616e6e656cc0a3646c6308a4646"
     "17461c4080"
     "000c03f"
     "00000000a569735f6664c2ae626974726174655f737769746368c2b56572726f725f73746174655f696e646963617"
     "46f72c2"},
    {"123#DEADBEEF", 0,
     "8ba974696d657374616d70cb0000000000000000ae6172626974726174696f6e5f6964cd0123ae69735f657874656"
     "e6465645f6"
     "964c2af"
     "69735f72656d6f74655f6672616d65c2ae69735f6572726f725f6672616d65c2a76368616e6e656cc0a3646c6304a"
     "464617461c"
     "404dead"
     "beefa569735f6664c2ae626974726174655f737769746368c2b56572726f725f73746174655f696e64696361746f7"
     "2c2"},
    {"029#R8", 0,
     "8ba974696d657374616d70cb0000000000000000ae6172626974726174696f6e5f696429ae69735f657874656e646"
     "5645f6964c"
     "2af6973"
     "5f72656d6f74655f6672616d65c3ae69735f6572726f725f6672616d65c2a76368616e6e656cc0a3646c6308a4646"
     "17461c400a"
     "569735f"
     "6664c2ae626974726174655f737769746368c2b56572726f725f73746174655f696e64696361746f72c2"},
    {"1ABCDEF0#0001020304050607", 0,
     "8ba974696d657374616d70cb0000000000000000ae6172626974726174696f6e5f6964ce1abcdef0ae69735f65787"
     "4656e64656"
     "45f6964"
     "c3af69735f72656d6f74655f6672616d65c2ae69735f6572726f725f6672616d65c2a76368616e6e656cc0a3646c6"
     "308a464617"
     "461c408"
     "0001020304050607a569735f6664c2ae626974726174655f737769746368c2b56572726f725f73746174655f696e6"
     "4696361746"
     "f72c2"},
    {"20000040#0000000000000000", 1700000000.125,
     "8ba974696d657374616d70cb41d954fc40080000ae6172626974726174696f6e5f696440ae69735f657874656e646"
     "5645f6964c"
     "2af6973"
     "5f72656d6f74655f6672616d65c2ae69735f6572726f725f6672616d65c3a76368616e6e656cc0a3646c6308a4646"
     "17461c4080"
     "0000000"
     "00000000a569735f6664c2ae626974726174655f737769746368c2b56572726f725f73746174655f696e646963617"
     "46f72c2"},
};

std::vector<uint8_t> Bytes(const std::string& hex) {
  std::vector<uint8_t> bytes;
  for (size_t i = 0; i < hex.size(); i += 2)
    bytes.push_back(static_cast<uint8_t>(std::stoi(hex.substr(i, 2), nullptr, 16)));
  return bytes;
}

std::vector<uint8_t> Encode(const Frame& frame, double timestamp = 0) {
  std::array<uint8_t, kMaxUdpDatagram> buffer;
  const size_t size = EncodeUdp(frame, timestamp, buffer);
  return {buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(size)};
}

TEST_CASE("datagrams are python-can's to the byte, both ways") {
  for (const Vector& vector : kVectors) {
    INFO(vector.text);
    const Frame frame = *FrameFromText(vector.text);
    const std::vector<uint8_t> datagram = Bytes(vector.datagram);
    CHECK(Encode(frame, vector.timestamp) == datagram);
    Frame decoded;
    REQUIRE(DecodeUdp(datagram, decoded));
    CHECK(ToText(decoded) == vector.text);
  }
}

TEST_CASE("FD frames survive the journey") {
  std::string text = "124##3";
  for (int i = 0; i < 64; ++i) text += "A5";
  const Frame frame = *FrameFromText(text);
  Frame decoded;
  REQUIRE(DecodeUdp(Encode(frame), decoded));
  CHECK(ToText(decoded) == text);
}

TEST_CASE("the order of keys is free, their set is not") {
  const std::vector<uint8_t> datagram = Encode(*FrameFromText("02E#0000C03F"));
  Frame frame;
  // "timestamp" and its value (19 bytes) moved to the end.
  std::vector<uint8_t> rotated = datagram;
  std::rotate(rotated.begin() + 1, rotated.begin() + 20, rotated.end());
  REQUIRE(DecodeUdp(rotated, frame));
  CHECK(ToText(frame) == "02E#0000C03F");

  std::vector<uint8_t> fewer(datagram.begin() + 20, datagram.end());
  fewer.insert(fewer.begin(), 0x8A);
  CHECK_FALSE(DecodeUdp(fewer, frame));

  std::vector<uint8_t> twice = datagram;  // the second key becomes the first again
  twice.insert(twice.begin() + 20, datagram.begin() + 1, datagram.begin() + 20);
  twice[0] = 0x8C;
  CHECK_FALSE(DecodeUdp(twice, frame));

  std::vector<uint8_t> unknown = datagram;
  unknown[3] = 'x';
  CHECK_FALSE(DecodeUdp(unknown, frame));

  std::vector<uint8_t> trailing = datagram;
  trailing.push_back(0xC0);
  CHECK_FALSE(DecodeUdp(trailing, frame));
}

TEST_CASE("every truncation is refused") {
  const std::vector<uint8_t> datagram = Encode(*FrameFromText("1ABCDEF0#0001020304050607"));
  Frame frame;
  for (size_t size = 0; size < datagram.size(); ++size)
    CHECK_FALSE(DecodeUdp(std::span(datagram).first(size), frame));
}

TEST_CASE("frames that cannot be are refused") {
  Frame good = *FrameFromText("02E#0000C03F00000000");
  Frame decoded;
  Frame bad = good;
  bad.id = 0x800;  // 12 bits
  CHECK_FALSE(DecodeUdp(Encode(bad), decoded));
  bad = good;
  bad.length = 9;
  CHECK_FALSE(DecodeUdp(Encode(bad), decoded));
  bad = good;
  bad.fd = true;
  bad.length = 13;
  CHECK_FALSE(DecodeUdp(Encode(bad), decoded));
  bad = good;
  bad.remote = bad.error = true;
  CHECK_FALSE(DecodeUdp(Encode(bad), decoded));
  bad = good;
  bad.bit_rate_switch = true;
  CHECK_FALSE(DecodeUdp(Encode(bad), decoded));
  // dlc 7 with 8 bytes of data: the byte before "data"'s key (0xa4).
  std::vector<uint8_t> datagram = Encode(good);
  const std::string text(datagram.begin(), datagram.end());
  datagram[text.find("dlc") + 3] = 7;
  CHECK_FALSE(DecodeUdp(datagram, decoded));
}

TEST_CASE("damaged datagrams never make an impossible frame") {
  Random random(1, {2});
  int accepted = 0;
  for (int trial = 0; trial < 200'000; ++trial) {
    std::vector<uint8_t> datagram = Encode(*FrameFromText(kVectors[trial % 5].text));
    const uint32_t flips = 1 + random.Bits() % 3;
    for (uint32_t i = 0; i < flips; ++i)
      datagram[random.Bits() % datagram.size()] ^= static_cast<uint8_t>(1u << random.Bits() % 8);
    Frame frame;
    if (!DecodeUdp(datagram, frame)) continue;
    ++accepted;
    if (!IsWellFormed(frame)) FAIL("not well formed: " << ToText(frame));
  }
  // Bits of data, id, timestamp and booleans can change and leave a frame; names, types and lengths
  // cannot.
  CHECK(accepted < 200'000 / 4);
  CHECK(accepted > 0);
}

TEST_CASE("random datagrams are refused") {
  Random random(1, {3});
  Frame frame;
  for (int trial = 0; trial < 100'000; ++trial) {
    std::array<uint8_t, 200> datagram;
    for (auto& byte : datagram) byte = static_cast<uint8_t>(random.Bits());
    datagram[0] = 0x8B;
    if (DecodeUdp(std::span(datagram).first(random.Bits() % 200), frame)) FAIL("accepted");
  }
}

}  // namespace
}  // namespace plumb
