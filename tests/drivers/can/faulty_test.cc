#include "drivers/can/faulty.h"

#include <array>
#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "drivers/can/error_frame.h"

namespace plumb {
namespace {

using Catch::Matchers::Contains;

/// A faulty transport and a sound one on the same loop, in virtual time.
struct Pair {
  explicit Pair(const std::string& faults, std::vector<Filter> filters = {})
      : faulty(OpenTransport("faulty:" + faults + ":loop:faulty", std::move(filters))),
        sound(OpenTransport("loop:faulty")) {
    SetTime(0);
  }
  void SetTime(int64_t now) {
    faulty->SetTime(now);
    sound->SetTime(now);
  }

  std::unique_ptr<Transport> faulty, sound;
};

Frame Numbered(uint32_t number) {
  Frame frame;
  frame.id = 0x29;
  frame.length = 4;
  for (size_t i = 0; i < 4; ++i) frame.data[i] = static_cast<uint8_t>(number >> (8 * i));
  return frame;
}
uint32_t Number(const Frame& frame) {
  return static_cast<uint32_t>(frame.data[0] | frame.data[1] << 8 | frame.data[2] << 16 |
                               frame.data[3] << 24);
}

std::vector<Frame> ReceiveAll(Transport& transport) {
  std::vector<Frame> all;
  std::array<Frame, 16> frames;
  // A call that hands out nothing need not be the last: what it saw may have been lost.
  for (int idle = 0; idle < 100;) {
    const int count = transport.Receive(frames);
    all.insert(all.end(), frames.begin(), frames.begin() + count);
    REQUIRE(all.size() < 1'000'000);
    idle = count == 0 ? idle + 1 : 0;
  }
  return all;
}

std::vector<uint32_t> Numbers(Transport& transport) {
  std::vector<uint32_t> numbers;
  for (const Frame& frame : ReceiveAll(transport)) numbers.push_back(Number(frame));
  return numbers;
}

/// Sends frames 0, 1, ... one by one. @return how many were accepted.
int SendNumbered(Transport& transport, uint32_t count) {
  int accepted = 0;
  for (uint32_t i = 0; i < count; ++i) {
    const Frame frame = Numbered(i);
    accepted += transport.Send({&frame, 1});
  }
  return accepted;
}

TEST_CASE("without faults everything passes as it is") {
  Pair bus("seed=3");
  CHECK(SendNumbered(*bus.sound, 100) == 100);
  CHECK(SendNumbered(*bus.faulty, 50) == 50);
  CHECK(Numbers(*bus.faulty).size() == 100);
  CHECK(Numbers(*bus.sound).size() == 50);
  CHECK(bus.faulty->stats().received == 100);
  CHECK(bus.faulty->stats().sent == 50);
  CHECK(bus.faulty->stats().injected == 0);
  CHECK(bus.faulty->NextEvent() == Transport::kNever);
}

TEST_CASE("frames are lost and doubled as often as asked, on the side that was asked") {
  Pair bus("rx.loss=0.25,tx.duplicate=0.1");
  constexpr int kFrames = 4000;
  int received = 0;
  for (int i = 0; i < kFrames / 100; ++i) {
    SendNumbered(*bus.sound, 100);
    received += static_cast<int>(ReceiveAll(*bus.faulty).size());
  }
  CHECK(received == Approx(0.75 * kFrames).margin(150));
  CHECK(bus.faulty->stats().injected == kFrames - received);
  int heard = 0;
  for (int i = 0; i < kFrames / 100; ++i) {
    CHECK(SendNumbered(*bus.faulty, 100) == 100);  // the sender is not told
    heard += static_cast<int>(ReceiveAll(*bus.sound).size());
  }
  CHECK(heard == Approx(1.1 * kFrames).margin(100));
}

TEST_CASE("frames change places with the next, and none is lost by it") {
  Pair bus("rx.reorder=0.3");
  SendNumbered(*bus.sound, 64);
  const std::vector<uint32_t> numbers = Numbers(*bus.faulty);
  CHECK(numbers.size() >= 63);  // the last one may be waiting for another
  int exchanged = 0;
  for (size_t i = 0; i < numbers.size(); ++i) {
    CHECK(std::abs(static_cast<int>(numbers[i]) - static_cast<int>(i)) <= 1);
    if (numbers[i] > i) ++exchanged;
  }
  CHECK(exchanged > 5);
}

TEST_CASE("corrupt frames differ in one bit of their payload") {
  Pair bus("rx.corrupt=1");
  const std::vector<Frame> frames = {Numbered(7), *FrameFromText("022#"), *FrameFromText("029#R8")};
  bus.sound->Send(frames);
  const std::vector<Frame> received = ReceiveAll(*bus.faulty);
  REQUIRE(received.size() == 3);
  CHECK(received[0].id == 0x29);
  CHECK(__builtin_popcount(Number(received[0]) ^ 7) == 1);
  CHECK(ToText(received[1]) == "022#");
  CHECK(ToText(received[2]) == "029#R8");
  CHECK(bus.faulty->stats().injected == 1);
}

TEST_CASE("delayed frames come when their time has come, in order") {
  Pair bus("rx.delay=2ms,rx.jitter=1ms,tx.delay=500us");
  SendNumbered(*bus.sound, 10);
  CHECK(Numbers(*bus.faulty).empty());
  CHECK(bus.faulty->NextEvent() >= 2000);
  CHECK(bus.faulty->NextEvent() < 3000);
  bus.SetTime(1999);
  CHECK(Numbers(*bus.faulty).empty());
  std::vector<uint32_t> numbers;
  int64_t time = 1999;
  while (bus.faulty->NextEvent() != Transport::kNever) {
    const int64_t next = bus.faulty->NextEvent();
    REQUIRE(next <= 3000);
    REQUIRE(next > time);
    time = next;
    bus.SetTime(next);
    for (const Frame& frame : ReceiveAll(*bus.faulty)) {
      numbers.push_back(Number(frame));
      CHECK(frame.receive_ns == 0);
    }
  }
  CHECK(numbers == std::vector<uint32_t>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9});

  CHECK(SendNumbered(*bus.faulty, 3) == 3);
  CHECK(Numbers(*bus.sound).empty());
  bus.SetTime(bus.faulty->NextEvent());
  CHECK(Numbers(*bus.sound) == std::vector<uint32_t>{0, 1, 2});
}

TEST_CASE("a full queue takes the beginning of a batch and drops the rest for good") {
  Pair bus("full=0.1,seed=5");
  int64_t accepted = 0;
  for (uint32_t i = 0; i < 100; ++i) {
    const std::array<Frame, 4> batch = {Numbered(4 * i), Numbered(4 * i + 1), Numbered(4 * i + 2),
                                        Numbered(4 * i + 3)};
    const int taken = bus.faulty->Send(batch);
    accepted += taken;
    const std::vector<uint32_t> numbers = Numbers(*bus.sound);
    REQUIRE(static_cast<int>(numbers.size()) == taken);
    for (size_t j = 0; j < numbers.size(); ++j) CHECK(numbers[j] == 4 * i + j);
  }
  CHECK(accepted < 390);
  CHECK(accepted > 200);
  CHECK(bus.faulty->stats().sent == accepted);
  CHECK(bus.faulty->stats().refused == 400 - accepted);
}

TEST_CASE("error frames come among the others") {
  Pair bus("errors=0.2");
  SendNumbered(*bus.sound, 64);
  int errors = 0, others = 0;
  for (const Frame& frame : ReceiveAll(*bus.faulty)) {
    CHECK(IsWellFormed(frame));
    CHECK(DecodeErrorFrame(frame) != BusEvent::kBusOff);
    ++(frame.error ? errors : others);
  }
  CHECK(others == 64);
  CHECK(errors > 4);
  CHECK(bus.faulty->stats().injected == errors);
}

TEST_CASE("bus-off: an error frame, silence for 100 ms, and another that it is over") {
  Pair bus("busoff=1");
  SendNumbered(*bus.sound, 3);
  const std::vector<Frame> received = ReceiveAll(*bus.faulty);
  REQUIRE(received.size() == 1);
  CHECK(DecodeErrorFrame(received[0]) == BusEvent::kBusOff);
  CHECK(SendNumbered(*bus.faulty, 2) == 0);
  CHECK(bus.faulty->stats().refused == 2);
  CHECK(bus.faulty->NextEvent() == 100'000);
  bus.SetTime(99'999);
  CHECK(ReceiveAll(*bus.faulty).empty());
  bus.SetTime(100'000);
  const std::vector<Frame> back = ReceiveAll(*bus.faulty);
  REQUIRE(back.size() == 1);
  CHECK(DecodeErrorFrame(back[0]) == BusEvent::kRestarted);
  CHECK(SendNumbered(*bus.faulty, 2) == 2);
  CHECK(Numbers(*bus.sound).size() == 2);
}

/// The frames that a faulty bus hands out and lets through.
std::string History(const std::string& faults) {
  Pair bus(faults);
  std::string history;
  for (int64_t now = 0; now < 50'000; now += 500) {
    bus.SetTime(now);
    SendNumbered(*bus.sound, 3);
    history += std::to_string(SendNumbered(*bus.faulty, 3));
    for (const Frame& frame : ReceiveAll(*bus.faulty)) history += " " + ToText(frame);
    history += " |";
    for (const Frame& frame : ReceiveAll(*bus.sound)) history += " " + ToText(frame);
    history += "\n";
  }
  return history;
}

TEST_CASE("the same seed and the same calls have the same faults") {
  const std::string faults =
      "loss=0.1,duplicate=0.1,reorder=0.1,corrupt=0.1,delay=1ms,jitter=2ms,full=0.05,errors=0.05,"
      "busoff=0.01,"
      "seed=";
  CHECK(History(faults + "1") == History(faults + "1"));
  CHECK(History(faults + "1") != History(faults + "2"));
}

TEST_CASE("a fault that is switched on leaves the others' luck alone") {
  const auto lost = [](const std::string& faults) {
    Pair bus(faults);
    SendNumbered(*bus.sound, 64);
    std::vector<bool> missing(64, true);
    for (const uint32_t number : Numbers(*bus.faulty)) missing[number % 64] = false;
    return missing;
  };
  CHECK(lost("rx.loss=0.3") == lost("rx.loss=0.3,rx.duplicate=0.5,errors=0.2,full=0.5"));
}

TEST_CASE("a flood neither overflows a lane nor stops it") {
  Pair bus("delay=1ms,duplicate=0.5,reorder=0.5");
  int accepted = 0;
  for (int i = 0; i < 100; ++i) accepted += SendNumbered(*bus.faulty, 100);
  CHECK(accepted < 10'000);  // nobody moves the time on
  CHECK(accepted > 1000);
  CHECK(bus.faulty->stats().refused == 10'000 - accepted);
  for (int i = 0; i < 100; ++i) {
    SendNumbered(*bus.sound, 100);
    ReceiveAll(*bus.faulty);
  }
  bus.SetTime(1000);
  CHECK(ReceiveAll(*bus.faulty).size() > 1000);
  CHECK(SendNumbered(*bus.faulty, 100) == 100);
}

TEST_CASE("faults nest, and pass on what the bus says") {
  const auto faulty = OpenTransport("faulty:rx.delay=1ms:faulty:rx.delay=2ms:loop:nested",
                                    {{.id = 0x29}, {.id = 0x2E, .own = true}});
  const auto sound = OpenTransport("loop:nested");
  faulty->SetTime(0);
  const std::array<Frame, 3> frames = {Numbered(1), *FrameFromText("02E#00"),
                                       *FrameFromText("100#00")};
  sound->Send(frames);
  CHECK(ReceiveAll(*faulty).empty());
  faulty->SetTime(2000);
  CHECK(ReceiveAll(*faulty).empty());
  faulty->SetTime(3000);
  const std::vector<Frame> received = ReceiveAll(*faulty);
  REQUIRE(received.size() == 2);
  CHECK_FALSE(received[0].foreign);
  CHECK(received[1].foreign);
  CHECK(faulty->stats().foreign == 1);
  CHECK_FALSE(faulty->is_replay());
}

TEST_CASE("faults that are none are named") {
  const auto error = [](const std::string& url) {
    try {
      OpenTransport(url);
    } catch (const std::runtime_error& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  CHECK_THAT(error("faulty:loss=0.1"), Contains("faults and a bus"));
  CHECK_THAT(error("faulty:lost=0.1:loop:x"), Contains("'lost=0.1'") && Contains("duplicate"));
  CHECK_THAT(error("faulty:rx.full=0.1:loop:x"), Contains("'rx.full=0.1'"));
  CHECK_THAT(error("faulty:tx.errors=0.1:loop:x"), Contains("'tx.errors=0.1'"));
  for (const char* bad :
       {"loss=1.1", "loss=-0.1", "loss=nan", "loss=", "loss=x", "delay=2", "delay=-1ms", "delay=2h",
        "delay=61s", "jitter=nans", "seed=-1", "seed=1.5"}) {
    INFO(bad);
    CHECK_THAT(error("faulty:" + std::string(bad) + ":loop:x"),
               Contains("'" + std::string(bad) + "'"));
  }
  CHECK_THAT(error("faulty:loss:loop:x"), Contains("'loss' is not NAME=VALUE"));
  CHECK_THAT(error("faulty:loss=0.1:nothing"), Contains("'nothing' is not socketcan:INTERFACE"));
  CHECK(error("faulty::loop:x").empty());
  CHECK(error("faulty:delay=0.5s,jitter=1e3us:loop:x").empty());
}

}  // namespace
}  // namespace plumb
