#include "common/log_limit.h"

#include <catch2/catch.hpp>

namespace plumb {
namespace {

constexpr int64_t kSecond = 1'000'000;  // [us]

TEST_CASE(
    "a kind of line may come in a burst, and then once a second; what was held back is counted") {
  LogLimit limit;
  int64_t written = 0, told = 0, said = 0;
  // A day of ten thousand lines a second, each with another number.
  for (int64_t now = 0; now < 86'400 * kSecond; now += kSecond / 10) {
    for (int i = 0; i < 10; ++i) {
      const auto held_back =
          limit.Admit("policy " + std::to_string(said++) + " refused: another robot's", now);
      if (!held_back) continue;
      ++written;
      told += *held_back;
    }
  }
  CHECK(written >= 86'400);
  CHECK(written <= 86'400 + LogLimit::kBurst);
  CHECK(told + written >= said - 200);  // all but those since the last that was written
  CHECK(told + written <= said);
}

TEST_CASE("one kind does not silence another") {
  LogLimit limit;
  for (int i = 0; i < 1000; ++i) limit.Admit("ignored: " + std::to_string(i), 0);
  CHECK_FALSE(limit.Admit("ignored: 1000", 0));
  CHECK(limit.Admit("halted: the drives are hot", 0) == 0);
  // After a silence as long as a burst it may come in a burst again.
  const int64_t later = LogLimit::kBurst * LogLimit::kPeriod;
  CHECK(limit.Admit("ignored: 1001", later) == 901);
  for (int i = 1; i < LogLimit::kBurst; ++i) CHECK(limit.Admit("ignored: again", later) == 0);
  CHECK_FALSE(limit.Admit("ignored: again", later));
}

TEST_CASE("whoever begins each line in another way gets no further") {
  LogLimit limit;
  int written = 0;
  for (int i = 0; i < 100'000; ++i) {
    std::string name;
    for (int rest = i; rest > 0; rest /= 26) name += static_cast<char>('a' + rest % 26);
    if (limit.Admit(name + ": hostile", 0)) ++written;
  }
  CHECK(written <= static_cast<int>(LogLimit::kMaxKinds) + LogLimit::kBurst);
}

}  // namespace
}  // namespace plumb
