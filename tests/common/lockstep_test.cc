// Runs in virtual time, with threads for processes.
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <thread>

#include "common/clock.h"
#include "common/lockstep/coordinator.h"
#include "common/lockstep/packet_socket.h"
#include "common/message_bytes.h"
#include "plumb/lockstep_grant_t.hpp"
#include "plumb/lockstep_hello_t.hpp"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

using Catch::Contains;
using Wake = Participant::Wake;

constexpr int64_t kStart = Coordinator::kBeginning;

std::vector<uint8_t> ToBytes(const std::string& text) { return {text.begin(), text.end()}; }
std::string Text(const lockstep_post_t& post) { return {post.data.begin(), post.data.end()}; }

/// A run, its transcript, and threads that take part in it.
class Run {
 public:
  Run() {
    coordinator.emplace((folder / "clock").string());
    coordinator->on_post = [this](const lockstep_post_t& post, const std::string& speaker) {
      transcript += std::to_string(coordinator->now() - kStart) + " " +
                    (speaker.empty() ? "owner" : speaker) + " " + post.topic.name + " " +
                    Text(post) + "\n";
    };
    coordinator->on_note = [this](const std::string& line) { notes += line + "\n"; };
  }
  ~Run() {
    // Threads that still wait are told that the run is over.
    coordinator.reset();
    for (std::thread& thread : threads) thread.join();
  }

  using Body = std::function<void(Participant&)>;
  void Start(const std::string& name, const Body& body) {
    coordinator->Expect(name, getpid());
    const std::string path = (folder / "clock").string();
    threads.emplace_back([name, body, path] {
      try {
        const auto participant = JoinRun(path, name);
        body(*participant);
      } catch (const std::exception&) {  // the run is over
      }
    });
  }
  /// For so long [us].
  void Pass(int64_t duration) {
    const int64_t end = coordinator->now() + duration;
    while (coordinator->now() < end) coordinator->participant().Wait(end, Wake::kOnTime);
  }

  TemporaryFolder temporary;
  const std::filesystem::path folder = temporary.path();
  std::optional<Coordinator> coordinator;
  std::string transcript, notes;
  std::vector<std::thread> threads;
};

/// Says what it is told, at every multiple of a period.
Run::Body Ticker(const std::string& channel, int64_t period) {
  return [=](Participant& run) {
    for (int64_t next = run.now() + period; !run.stopping(); next += period) {
      while (run.now() < next && !run.stopping()) run.Wait(next, Wake::kWhenHeard);
      if (!run.stopping()) run.Say(ChannelTopic(channel), ToBytes("tick"));
    }
  };
}

/// Answers all that it hears on a channel.
Run::Body Answerer(const std::string& from, const std::string& to, Wake wake = Wake::kWhenHeard) {
  return [=](Participant& run) {
    run.Listen(ChannelTopic(from));
    while (!run.stopping()) {
      run.Wait(run.now() + 25, wake);
      for (; !run.messages().empty(); run.messages().pop_front()) {
        run.Say(ChannelTopic(to), ToBytes("to " + Text(run.messages().front())));
      }
    }
  };
}

TEST_CASE("turns are taken in the order of Expect, and time moves on when all is said") {
  const auto transcript = [] {
    Run run;
    run.Start("b", Ticker("B", 20));
    run.Start("a", Ticker("A", 10));
    run.Start("c", Answerer("A", "C"));
    run.Start("d", Answerer("C", "D"));
    run.Pass(40);
    CHECK(run.coordinator->now() == kStart + 40);
    return run.transcript;
  };
  const std::string expected =
      "10 a A tick\n10 c C to tick\n10 d D to to tick\n"
      "20 b B tick\n20 a A tick\n20 c C to tick\n20 d D to to tick\n"
      "30 a A tick\n30 c C to tick\n30 d D to to tick\n"
      "40 b B tick\n40 a A tick\n40 c C to tick\n40 d D to to tick\n";
  for (int i = 0; i < 10; ++i) CHECK(transcript() == expected);
}

TEST_CASE("who is not to be woken hears on time, in order") {
  Run run;
  run.Start("a", Ticker("A", 10));
  run.Start("c", Answerer("A", "C", Wake::kOnTime));
  run.Pass(50);
  CHECK(run.transcript ==
        "10 a A tick\n20 a A tick\n25 c C to tick\n25 c C to tick\n"
        "30 a A tick\n40 a A tick\n50 a A tick\n50 c C to tick\n50 c C to tick\n50 c C to tick\n");
}

TEST_CASE("what is on its way arrives when it is said to, in order of arrival") {
  Run run;
  std::vector<std::string> heard;
  run.coordinator->participant().Listen(BusTopic("loop:x"));
  run.Start("a", [](Participant& self) {
    self.Say(BusTopic("loop:x"), ToBytes("slow"), 100);
    self.Say(BusTopic("loop:x"), ToBytes("fast"), 30);
    self.Say(BusTopic("loop:y"), ToBytes("elsewhere"), 0);
    self.Listen(BusTopic("loop:x"));  // and hears nothing of its own
    self.Wait(kStart + 1000, Wake::kWhenHeard);
    self.Fail(self.now() == kStart + 1000 ? "it has slept" : "it has heard itself");
    self.Wait(kStart + 2000, Wake::kWhenHeard);
  });
  Participant& owner = run.coordinator->participant();
  auto& frames = owner.frames("loop:x");
  owner.Wait(kStart + 500, Wake::kWhenHeard);
  CHECK(owner.now() == kStart + 30);
  REQUIRE(frames.size() == 1);
  CHECK(Text(frames.front()) == "fast");
  frames.clear();
  owner.Wait(kStart + 500, Wake::kWhenHeard);
  CHECK(owner.now() == kStart + 100);
  REQUIRE(frames.size() == 1);
  CHECK(frames.front().arrival == kStart + 100);
  frames.clear();
  CHECK_THROWS_WITH(run.Pass(5000), "a: it has slept");
}

TEST_CASE("one's own messages come back, as LCM's do") {
  Run run;
  Participant& owner = run.coordinator->participant();
  owner.Listen(ChannelTopic("X"));
  owner.Say(ChannelTopic("X"), ToBytes("hello"));
  owner.Wait(kStart + 10, Wake::kWhenHeard);
  CHECK(owner.now() == kStart);
  REQUIRE(owner.messages().size() == 1);
  CHECK(Text(owner.messages().front()) == "hello");
}

TEST_CASE("a stalled participant has no turn; then it hears all of it") {
  Run run;
  run.Start("a", Ticker("A", 10));
  run.Start("c", Answerer("A", "C"));
  run.Pass(15);
  run.coordinator->Stall("c", 20);
  run.transcript.clear();
  run.Pass(25);
  CHECK(run.transcript ==
        "20 a A tick\n30 a A tick\n35 c C to tick\n35 c C to tick\n40 a A tick\n40 c C to tick\n");
}

TEST_CASE("on the way to a listener things get lost, late, doubled and altered") {
  Run run;
  run.Start("a", Ticker("A", 10));
  run.Start("b", Answerer("A", "B"));
  run.Start("c", Answerer("A", "C"));
  run.coordinator->on_way = [&](lockstep_post_t post, const std::string& speaker,
                                const std::string& listener) {
    std::vector<lockstep_post_t> heard{post};
    if (listener != "c") return heard;
    CHECK(speaker == "a");
    switch ((run.coordinator->now() - kStart) / 10) {
      case 1:
        heard.clear();
        break;
      case 2:
        heard[0].arrival += 15;
        break;
      case 3:
        heard[0].data = ToBytes("TICK");
        heard[0].size = 4;
        heard.push_back(post);
        break;
    }
    return heard;
  };
  run.Pass(40);
  CHECK(run.transcript ==
        "10 a A tick\n10 b B to tick\n20 a A tick\n20 b B to tick\n"
        "30 a A tick\n30 b B to tick\n30 c C to TICK\n30 c C to tick\n35 c C to tick\n"
        "40 a A tick\n40 b B to tick\n40 c C to tick\n");
}

TEST_CASE("who has the wrong date has it until it is set right, and sleeps as long as ever") {
  Run run;
  run.Start("a", [](Participant& self) {
    const Clock clock(self.time());
    for (int i = 1; !self.stopping(); ++i) {
      while (self.now() < kStart + 10 * i) self.Wait(kStart + 10 * i, Wake::kOnTime);
      self.Say(ChannelTopic("A"), ToBytes(std::to_string(clock.Utime() - clock.Now())));
    }
  });
  run.Pass(15);
  run.coordinator->SetClockError("a", -3'600'000'000);
  run.Pass(10);
  run.coordinator->SetClockError("a", 0);
  run.Pass(10);
  CHECK(run.transcript == "10 a A 0\n20 a A -3600000000\n30 a A 0\n");
}

TEST_CASE(
    "one that dies is gone at that moment, and the others go on; one of its name may come again") {
  Run run;
  run.Start("a", Ticker("A", 10));
  const auto die_at = [](int64_t moment) {
    return [moment](Participant& self) {
      self.Listen(ChannelTopic("A"));
      while (self.now() < kStart + moment)
        self.Wait(kStart + moment, Wake::kWhenHeard), self.messages().clear();
      self.Say(ChannelTopic("C"), ToBytes("last words"));
    };
  };
  run.Start("c", die_at(20));
  run.Pass(30);
  CHECK_FALSE(run.coordinator->present("c"));
  run.Start("c", die_at(40));
  run.Pass(30);
  CHECK(run.transcript ==
        "10 a A tick\n20 a A tick\n20 c C last words\n30 a A tick\n40 a A tick\n40 c C last words\n"
        "50 a A tick\n60 a A tick\n");
}

TEST_CASE("one that is asked to stop ends at that moment") {
  Run run;
  run.Start("a", Ticker("A", 10));
  run.Pass(25);
  run.coordinator->Stop("a");
  run.Pass(1);
  CHECK_FALSE(run.coordinator->present("a"));
  CHECK(run.transcript == "10 a A tick\n20 a A tick\n");
}

TEST_CASE("a hurried owner is let go, and comes back to the same moment") {
  Run run;
  run.Start("a", Ticker("A", 10));
  run.Pass(10);
  bool hurry = true;
  run.coordinator->Expect("late", getpid());  // never comes
  run.coordinator->go_on = [&] { return !hurry; };
  run.coordinator->participant().Wait(kStart + 100, Wake::kOnTime);
  CHECK(run.coordinator->now() == kStart + 10);
  hurry = false;
  run.Start("late", Ticker("L", 10));
  run.Pass(10);
  CHECK(run.transcript == "10 a A tick\n20 a A tick\n20 late L tick\n");
}

TEST_CASE("who does not belong is refused with one line") {
  Run run;
  const std::string path = (run.folder / "clock").string();
  run.Start("a", Ticker("A", 10));
  run.Pass(10);
  const auto refusal = [&](const std::function<void()>& join) {
    std::string line;
    std::atomic<bool> done = false;
    std::thread stranger([&] {
      try {
        join();
      } catch (const std::exception& error) {
        line = error.what();
      }
      line += " ";
      done = true;
    });
    // The coordinator hears it when the owner waits.
    for (int i = 0; i < 10'000 && !done; ++i) run.Pass(10);
    stranger.join();
    return line;
  };
  CHECK_THAT(refusal([&] { JoinRun(path, "a"); }), Contains("there is a a in the run already"));
  CHECK_THAT(refusal([&] {
               PacketSocket socket = PacketSocket::Connect(path);
               lockstep_hello_t hello{};
               hello.version = "0.0.1 (abc)";
               hello.name = "old";
               std::vector<uint8_t> buffer;
               socket.Send(Encode(hello, buffer));
               while (socket.Read(PacketSocket::When::kSoon) && socket.Next().empty()) usleep(1000);
             }),
             Contains(" "));
  CHECK_THAT(run.notes, Contains("refused: old is 0.0.1 (abc), the run is "));
  // Whatever else is written there ends the connection and nothing else.
  for (const std::string& garbage : {std::string("\xff\xff\xff\xff garbage"), std::string(8, '\0'),
                                     std::string("\4\0\0\0abcd", 8)}) {
    refusal([&] {
      PacketSocket socket = PacketSocket::Connect(path);
      send(socket.fd(), garbage.data(), garbage.size(), MSG_NOSIGNAL);
      while (socket.Read(PacketSocket::When::kSoon)) socket.Next(), usleep(1000);
    });
  }
  run.transcript.clear();
  run.Pass(20);
  CHECK(std::count(run.transcript.begin(), run.transcript.end(), '\n') == 2);
}

TEST_CASE("where nobody keeps time there is one clear line") {
  Run run;
  CHECK_THROWS_WITH(JoinRun((run.folder / "nothing").string(), "a"),
                    Contains("nobody keeps a run's time there"));
  CHECK_THROWS_WITH(JoinRun("/nowhere/at/all", "a"),
                    Contains("/nowhere/at: cannot open the folder"));
  std::ofstream(run.folder / "file") << "text";
  CHECK_THROWS_WITH(JoinRun((run.folder / "file").string(), "a"),
                    Contains("nobody keeps a run's time there"));
}

TEST_CASE("a path longer than a socket's address will do") {
  Run run;
  std::filesystem::path deep = run.folder;
  for (int i = 0; i < 10; ++i) deep /= "a_rather_long_name_of_a_folder";
  std::filesystem::create_directories(deep);
  Coordinator coordinator((deep / "clock").string());
  coordinator.Expect("a", getpid());
  std::thread thread(
      [&] { JoinRun((deep / "clock").string(), "a")->Wait(kStart + 5, Wake::kOnTime); });
  coordinator.participant().Wait(kStart + 10, Wake::kOnTime);
  CHECK(coordinator.now() == kStart + 10);
  thread.join();
}

}  // namespace
}  // namespace plumb
