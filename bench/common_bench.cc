// What it costs to seal a message and to judge it, with a key and without: a command of 12 joints,
// a policy of 70 kB.

#include <benchmark/benchmark.h>
#include <unistd.h>

#include <filesystem>
#include <vector>

#include "common/identity.h"

namespace plumb {
namespace {

constexpr char kChannel[] = "JOINT_COMMAND";

struct Two {
  explicit Two(bool with_key) {
    const std::filesystem::path file =
        std::filesystem::temp_directory_path() / ("plumb-seal-bench-" + std::to_string(getpid()));
    std::optional<SigningKey> key;
    if (with_key) {
      MakeKeyFile(file);
      key.emplace(file);
      std::filesystem::remove(file);
    }
    driver = Identity("driver", key, Clock(), Identity::Reach::kMachine, 0);
    controller = Identity("controller", key, Clock(), Identity::Reach::kMachine, 0);
    driver.Lead("hopper", "socketcan:can0");
    if (with_key) controller.Join(driver.run(), "hopper", "socketcan:can0");
  }
  Identity driver, controller;
};

/// @param range bytes of the message; whether there is a key.
void Seal(benchmark::State& state) {
  Two two(state.range(1) != 0);
  std::vector<uint8_t> message(static_cast<size_t>(state.range(0)) + kSealSize, 0x55);
  for (auto _ : state) two.controller.Seal(kChannel, message);
}

/// Sealing it as well, as what is judged twice is refused the second time.
void SealAndJudge(benchmark::State& state) {
  Two two(state.range(1) != 0);
  ChannelJudge judge;
  std::vector<uint8_t> message(static_cast<size_t>(state.range(0)) + kSealSize, 0x55);
  for (auto _ : state) {
    two.controller.Seal(kChannel, message);
    if (!judge.Hear(two.driver, kChannel, message).refusal.empty()) state.SkipWithError("refused");
  }
}

#define SIZES ArgNames({"bytes", "key"})->ArgsProduct({{560, 70'000}, {0, 1}})
BENCHMARK(Seal)->SIZES;
BENCHMARK(SealAndJudge)->SIZES;

}  // namespace
}  // namespace plumb
