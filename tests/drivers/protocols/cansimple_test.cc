#include "drivers/protocols/cansimple.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

namespace plumb::cansimple {
namespace {

// Frames of node 1, written by hand from the protocol's documentation and checked with
// python3-canmatrix: they share nothing with our tables.
struct Row {
  const Layout* layout;
  std::vector<double> values;
  const char* text;
};
const Row kRows[] = {
    {&kSetAxisState, {8}, "027#0800000000000000"},
    {&kSetControllerMode, {1, 1}, "02B#0100000001000000"},
    {&kSetInputTorque, {1.5}, "02E#0000C03F00000000"},
    {&kSetInputTorque, {-0.1}, "02E#CDCCCCBD00000000"},
    {&kSetInputPos, {0.5, -1.5, 0.25}, "02C#0000003F24FAFA00"},
    {&kSetInputVel, {-2, 0.125}, "02D#000000C00000003E"},
    {&kClearErrors, {0}, "038#00"},
    {&kEstop, {}, "022#"},
    {&kHeartbeat, {0, 8, 0, 0}, "021#0000000008000000"},
    {&kHeartbeat, {1 << 24, 1, 3, 0}, "021#0000000101030000"},
    {&kGetError, {0, 1 << 24}, "023#0000000000000001"},
    {&kGetEncoderEstimates, {-0.25, 3.5}, "029#000080BE00006040"},
    {&kGetIq, {2, 1.9375}, "034#000000400000F83F"},
    {&kGetTemperature, {41.5, 36.25}, "035#0000264200001142"},
    {&kGetBusVoltageCurrent, {24, 1.25}, "037#0000C0410000A03F"},
    {&kGetTorques, {1.5, 1.4375}, "03C#0000C03F0000B83F"},
    {&kGetVersion, {2, 4, 4, 58, 0, 6, 10, 0}, "020#0204043A00060A00"},
    {&kRxSdo, {1, 0x1A2, 0, 1.234}, "024#01A20100B6F39D3F"},
    {&kRxSdoRead, {0, 0x1A2, 0}, "024#00A20100"},
    {&kTxSdo, {0, 0x1A2, 0, 1.234}, "025#00A20100B6F39D3F"},
};

Frame MakeFromVector(const Layout& layout, int node, const std::vector<double>& v) {
  switch (v.size()) {
    case 0:
      return Make(layout, node);
    case 1:
      return Make(layout, node, {v[0]});
    case 2:
      return Make(layout, node, {v[0], v[1]});
    case 3:
      return Make(layout, node, {v[0], v[1], v[2]});
    case 4:
      return Make(layout, node, {v[0], v[1], v[2], v[3]});
    default:
      return Make(layout, node, {v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7]});
  }
}

TEST_CASE("messages have the documented bytes, both ways") {
  for (const Row& row : kRows) {
    INFO(row.layout->name);
    CHECK(row.layout->count() == row.values.size());
    CHECK(ToText(MakeFromVector(*row.layout, 1, row.values)) == row.text);
    const auto values = DecodePayload(*row.layout, *FrameFromText(row.text));
    REQUIRE(values);
    for (size_t i = 0; i < row.values.size(); ++i) {
      INFO(row.layout->fields[i].name);
      CHECK((*values)[i] == Approx(row.values[i]).epsilon(1e-7));
    }
  }
}

TEST_CASE("requests are remote frames, the address is unaddressed, short setpoints are known") {
  CHECK(ToText(MakeRequest(kGetEncoderEstimates, 1)) == "029#R");
  CHECK(ToText(MakeRequest(kAddress, kBroadcastNode)) == "7E6#R");
  CHECK(ToText(Make(kAddress, kBroadcastNode, {1, static_cast<double>(0x335E3D563432)})) ==
        "7E6#013234563D5E33");
  const auto values = DecodePayload(kAddress, *FrameFromText("7E6#013234563D5E3300"));
  REQUIRE(values);
  CHECK((*values)[0] == 1);
  CHECK((*values)[1] == static_cast<double>(0x335E3D563432));
  const auto idle = DecodePayload(kSetAxisState, *FrameFromText("027#01000000"));
  REQUIRE(idle);
  CHECK((*idle)[0] == 1);
}

TEST_CASE("what must be rejected") {
  CHECK_FALSE(DecodePayload(kGetEncoderEstimates, *FrameFromText("029#000080BE")));
  CHECK_FALSE(DecodePayload(kGetEncoderEstimates, *FrameFromText("029#R8")));
  CHECK_FALSE(
      DecodePayload(kGetEncoderEstimates, *FrameFromText("029##0000080BE00006040000080BE")));
  const auto nan = DecodePayload(kGetEncoderEstimates, *FrameFromText("029#0000C07F00006040"));
  REQUIRE(nan);
  CHECK_FALSE(AllFinite(kGetEncoderEstimates, *nan));
}

TEST_CASE("integers saturate, round to nearest, and take no nonsense") {
  constexpr Field field{"x", 8, 16, Field::Kind::kSigned, 0.001, ""};
  const auto round_trip = [&](double value) { return field.Decode(field.Encode(value)); };
  CHECK(round_trip(32.7674) == Approx(32.767));
  CHECK(round_trip(99) == Approx(32.767));
  CHECK(round_trip(-99) == Approx(-32.768));
  CHECK(round_trip(-0.0016) == Approx(-0.002));
  CHECK(round_trip(std::numeric_limits<double>::quiet_NaN()) == 0);
  CHECK(round_trip(std::numeric_limits<double>::infinity()) == Approx(32.767));
  CHECK((field.Encode(-1) & ~(uint64_t{0xFFFF} << 8)) == 0);  // touches no neighbour
  constexpr Field byte{"x", 0, 8};
  CHECK(byte.Decode(byte.Encode(300)) == 255);
  CHECK(byte.Decode(byte.Encode(-3)) == 0);
  static_assert(kGetVersion.needed() == 8 && kHeartbeat.needed() == 7 && kEstop.needed() == 0);
}

TEST_CASE("errors in words") {
  std::array<char, 64> buffer;
  CHECK(DescribeErrors(0, buffer) == "no error");
  CHECK(DescribeErrors(kWatchdogTimerExpired, buffer) == "watchdog timer expired");
  CHECK(DescribeErrors(kWatchdogTimerExpired | kEstopRequested, buffer) ==
        "watchdog timer expired, estop requested");
  CHECK(DescribeErrors(1u << 31, buffer) == "an unknown error");
  CHECK(DescribeErrors(~0u, buffer).size() == 64);  // cut, not overrun
  CHECK(DescribeAxisState(1) == "IDLE");
  CHECK(DescribeAxisState(-1) == "unknown state");
  CHECK(DescribeAxisState(200) == "unknown state");
  CHECK(DescribeProcedureResult(3) == "disarmed");
  CHECK(DescribeProcedureResult(99) == "unknown result");
}

}  // namespace
}  // namespace plumb::cansimple
