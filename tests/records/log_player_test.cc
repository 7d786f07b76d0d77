#include "records/log_player.h"

#include <catch2/catch.hpp>
#include <filesystem>
#include <limits>
#include <numeric>

#include "tests/records/log_file.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

constexpr int64_t kFirst = 1'700'000'000'000'000;

int Next(const LogPlayer& player) {
  return std::stoi(std::string(player.next().data.begin(), player.next().data.end()));
}

/// Ten messages a second for ten seconds.
struct TenSeconds {
  TenSeconds() {
    std::vector<int64_t> times(101);
    for (size_t i = 0; i < times.size(); ++i) times[i] = kFirst + 100'000 * static_cast<int64_t>(i);
    WriteLog(file, times);
  }
  TemporaryFolder folder;
  const std::string file = folder / "a.lcmlog";
};

TEST_CASE_METHOD(TenSeconds, "each message is due at its time, at any speed") {
  LogPlayer player(file, {}, 2, 1000);
  CHECK(player.duration() == Approx(10));
  CHECK(Next(player) == 0);
  CHECK(player.Remaining(1000) == 0);
  player.Advance(1000);
  CHECK(player.Remaining(1000) == 50'000);
  CHECK(player.Remaining(1000 + 60'000) == -10'000);
  CHECK(player.Position(1000 + 60'000) == Approx(0.12));
  // From there on four times slower.
  player.SetSpeed(0.5, 1000 + 40'000);
  CHECK(player.Remaining(1000 + 40'000) == 40'000);
  player.SetSpeed(0, 1000 + 40'000);
  for (; !player.over(); player.Advance(1000 + 40'000))
    REQUIRE(player.Remaining(1000 + 40'000) == 0);
  CHECK(player.Position(1000 + 40'000) == Approx(10));
}

TEST_CASE("who waits for a long log is told how far it is, and may break off") {
  const TemporaryFolder folder;
  WriteLog(folder / "a.lcmlog", std::vector<int64_t>(3500, kFirst));
  std::vector<double> shares;
  const auto told = [&](double share) { shares.push_back(share); };
  CHECK(LogPlayer(folder / "a.lcmlog", {}, 1, 0, told).index().messages() == 3500);
  REQUIRE(shares.size() == 4);
  CHECK(shares.front() == 0);
  CHECK(shares.back() == Approx(3000. / 3500).margin(0.01));
  CHECK(std::ranges::is_sorted(shares));
  struct Stopped {};
  const auto stop = [](double share) {
    if (share > 0.5) throw Stopped();
  };
  CHECK_THROWS_AS(LogPlayer(folder / "a.lcmlog", {}, 1, 0, stop), Stopped);
}

TEST_CASE_METHOD(TenSeconds, "a pause lasts until it ends, and nothing is skipped by it") {
  LogPlayer player(file, {}, 1, 0);
  player.Advance(0);
  player.Pause(true, 30'000);
  CHECK(player.Remaining(5'000'000) > 1'000'000'000);
  CHECK(player.Position(5'000'000) == Approx(0.03));
  player.Pause(false, 5'000'000);
  CHECK(player.Remaining(5'000'000) == 70'000);
  CHECK(Next(player) == 1);
}

TEST_CASE_METHOD(TenSeconds, "seeking finds the message of that time, back and forth") {
  LogPlayer player(file, {}, 1, 0);
  for (const double position : {7.25, 0.0, 10.0, 3.0, 2.999, -4.0, 99.0}) {
    player.Seek(position, 500);
    const double there = std::clamp(position, 0.0, 10.0);
    CHECK(Next(player) == std::ceil(there * 10 - 1e-9));
    CHECK(player.Position(500) == Approx(there));
  }
}

TEST_CASE_METHOD(TenSeconds, "a part is played from its beginning to its end, once or again") {
  LogPlayer once(file, {2, 2.3}, 1, 0);
  std::vector<int> played;
  for (; !once.over(); once.Advance(0)) played.push_back(Next(once));
  CHECK(played == std::vector<int>{20, 21, 22, 23});
  LogPlayer again(file, {2, 2.3, true}, 0, 0);
  played.clear();
  for (int i = 0; i < 10; ++i, again.Advance(0)) played.push_back(Next(again));
  CHECK(played == std::vector<int>{20, 21, 22, 23, 20, 21, 22, 23, 20, 21});
  again.Seek(9, 0);  // beyond it
  CHECK(Next(again) == 23);
  CHECK_THROWS_WITH(LogPlayer(file, {11, 12}, 1, 0),
                    file + ": has no message from 11 s on to 12 s: it takes 10 s");
}

TEST_CASE("of a long log any moment is found, though some messages are late") {
  const TemporaryFolder folder;
  const std::string file = folder / "a.lcmlog";
  std::vector<int64_t> times(10'000);
  for (size_t i = 0; i < times.size(); ++i)
    times[i] = kFirst + 1000 * static_cast<int64_t>(i) - (i % 7 == 3 ? 2500 : 0);
  WriteLog(file, times);
  LcmLogReader log(file);
  const LogIndex index(log);
  CHECK(index.messages() == 10'000);
  LcmLogEvent event;
  for (const size_t i :
       {size_t{0}, size_t{1}, size_t{999}, size_t{1000}, size_t{5555}, size_t{9998}}) {
    const int64_t wanted = kFirst + 1000 * static_cast<int64_t>(i);
    index.Seek(log, wanted);
    REQUIRE(log.Read(event));
    const auto first = std::ranges::find_if(times, [&](int64_t t) { return t >= wanted; });
    CHECK(std::string(event.data.begin(), event.data.end()) ==
          std::to_string(first - times.begin()));
  }
  index.Seek(log, kFirst + 10'000'000);
  CHECK_FALSE(log.Read(event));
}

TEST_CASE("hostile times overflow nothing, and what is due at no time can be passed") {
  const TemporaryFolder folder;
  const std::string file = folder / "a.lcmlog";
  constexpr int64_t kLeast = std::numeric_limits<int64_t>::min(),
                    kMost = std::numeric_limits<int64_t>::max();
  WriteLog(file, {0, kMost, kLeast, 5, kMost});
  LogPlayer player(file, {}, 1, 0);
  int played = 0;
  for (; !player.over(); player.Advance(10), ++played) {
    const int64_t remaining = player.Remaining(10);
    CHECK(std::abs(remaining) < int64_t{1} << 52);
    player.Position(10);
  }
  CHECK(played == 5);
  player.Seek(1e300, 0);
  player.Seek(-1e300, 0);
  CHECK(Next(player) == 0);
}

TEST_CASE("a log that was cut off ends there; one that is damaged is refused, by its byte") {
  const TemporaryFolder folder;
  const std::string file = folder / "a.lcmlog";
  WriteLog(file, {0, 1, 2});
  std::filesystem::resize_file(file, std::filesystem::file_size(file) - 1);
  LcmLogReader log(file);
  const LogIndex index(log);
  CHECK(index.messages() == 2);
  CHECK(index.cut_off());
  std::filesystem::resize_file(file, 60);  // and zeros behind it
  std::filesystem::resize_file(file, 200);
  CHECK_THROWS_WITH(LogPlayer(file, {}, 1, 0), file + ": damaged at byte 60");
  std::filesystem::resize_file(file, 0);
  CHECK_THROWS_WITH(LogPlayer(file, {}, 1, 0), file + ": has no message");
  CHECK_THROWS_WITH(LogPlayer(folder / "none", {}, 1, 0), folder / "none" + ": cannot be opened");
  CHECK_THROWS_WITH(LogPlayer(folder / "", {}, 1, 0), folder / "" + ": is a folder");
}

}  // namespace
}  // namespace plumb
