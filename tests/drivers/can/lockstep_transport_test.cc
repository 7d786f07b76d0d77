// A bus in virtual time: the coordinator says when and in which order frames arrive, the bus that
// they do.
#include "drivers/can/lockstep_transport.h"

#include <array>
#include <catch2/catch.hpp>

#include "common/lockstep/participant.h"
#include "drivers/can/loop.h"

namespace plumb {
namespace {

using Catch::Contains;

constexpr char kBus[] = "udp:239.74.163.2:43113";

/// A run that consists of what the test makes up.
class MadeUpRun : public Participant {
 public:
  void Listen(const lockstep_topic_t& topic) override { listens = topic.name; }
  void Say(const lockstep_topic_t& topic, std::vector<uint8_t> data, int64_t way) override {
    said += topic.name + " " + std::string(data.begin(), data.end()) + " " +
            std::to_string(now() + way) + "\n";
  }
  void Wait(int64_t until, Wake, int = -1, const std::function<void()>& = {}) override {
    SetNow(until);
  }
  void ShareProcessor() override {}
  void Note(const std::string& line) override { noted += line + "\n"; }
  void Fail(const std::string& why) override { failed += why + "\n"; }

  void Arrives(const std::string& text, int64_t arrival) {
    lockstep_post_t post;
    post.topic = BusTopic(kBus);
    post.arrival = arrival;
    post.data.assign(text.begin(), text.end());
    post.size = static_cast<int32_t>(post.data.size());
    Hear(std::move(post));
  }
  std::string listens, said, noted, failed;
};

struct Rig {
  explicit Rig(std::vector<Filter> filters = {})
      : others(OpenLoop("lockstep", {})),
        transport(OpenLockstep(kBus, OpenLoop("lockstep", filters), filters, {&run, 110, 3})) {}
  std::string Receive() {
    std::array<Frame, 8> frames;
    std::string text;
    const int count = transport->Receive(frames);
    for (const Frame& frame : std::span(frames).first(static_cast<size_t>(count)))
      text += ToText(frame) + "@" + std::to_string(frame.receive_ns) + (frame.foreign ? "! " : " ");
    return text;
  }
  void SendByOthers(const std::string& text) {
    const Frame frame = *FrameFromText(text);
    others->Send({&frame, 1});
  }
  MadeUpRun run;
  std::unique_ptr<Transport> others, transport;
};

TEST_CASE(
    "frames are handed out in the run's order and at its time, once the bus has brought them") {
  Rig rig;
  CHECK(rig.run.listens == kBus);
  rig.SendByOthers("029#01");
  rig.SendByOthers("021#02");
  CHECK(rig.Receive().empty());  // not yet, says the run
  rig.run.Arrives("021#02", 1'000);
  rig.run.Arrives("029#01", 1'110);
  CHECK(rig.Receive() == "021#02@1000000 029#01@1110000 ");
  CHECK(rig.Receive().empty());
  CHECK(rig.transport->stats().received == 2);
}

TEST_CASE("what is sent goes out on the bus and is said in the run, with its way") {
  Rig rig;
  rig.run.Wait(5'000, Participant::Wake::kOnTime, -1);
  const std::array<Frame, 2> frames{*FrameFromText("02E#0000C03F"), *FrameFromText("029#R")};
  CHECK(rig.transport->Send(frames) == 2);
  CHECK(rig.run.said == std::string(kBus) + " 02E#0000C03F 5110\n" + kBus + " 029#R 5110\n");
  std::array<Frame, 4> heard;
  REQUIRE(rig.others->Receive(heard) == 2);
  CHECK(ToText(heard[0]) == "02E#0000C03F");
  CHECK(rig.transport->stats().sent == 2);
}

TEST_CASE("frames that the filters keep out, or that only we may send, are as on any bus") {
  Rig rig({{.id = 0x029}, {.id = 0x02E, .own = true}});
  for (const char* text : {"029#01", "02E#00", "033#03"}) {
    rig.SendByOthers(text);
    rig.run.Arrives(text, 7);
  }
  CHECK(rig.Receive() == "029#01@7000 02E#00@7000! ");
  CHECK(rig.transport->stats().foreign == 1);
}

TEST_CASE("who is outside the run is named once, and not heard") {
  Rig rig;
  for (int i = 0; i < 3; ++i) rig.SendByOthers("029#66");
  CHECK(rig.Receive().empty());
  rig.run.Wait(200'000, Participant::Wake::kOnTime, -1);
  CHECK(rig.Receive().empty());
  CHECK(rig.run.noted ==
        "029#66 on " + std::string(kBus) +
            " is from outside the run, and ignored: --real-time hears everybody\n");
  rig.run.Arrives("029#66", 200'000);
  rig.SendByOthers("029#66");
  CHECK(rig.Receive() == "029#66@200000000 ");
  CHECK(rig.run.failed.empty());
}

TEST_CASE("a frame that was sent and does not arrive ends the run with its name and number") {
  Rig rig;
  rig.SendByOthers("029#01");
  rig.run.Arrives("029#01", 1);
  rig.run.Arrives("029#02", 1);  // lost
  CHECK(rig.Receive() == "029#01@1000 ");
  CHECK(rig.run.failed == "lost on " + std::string(kBus) + ": 029#02, frame 2 for this process\n");
}

TEST_CASE("where there is no other bus the run is the bus") {
  MadeUpRun run;
  const auto transport = OpenTransport("loop:anything", {}, {&run, 0});
  CHECK(run.listens == "loop:anything");
  const Frame frame = *FrameFromText("029#01");
  CHECK(transport->Send({&frame, 1}) == 1);
  CHECK(run.said == "loop:anything 029#01 0\n");
  CHECK(transport->Reopen() == LinkState::kUp);
}

}  // namespace
}  // namespace plumb
