// A robot that no simulator of ours contains, through the whole loop: what the model lacks is
// learnt beside its parameters, and the robot runs what has done best on it, not what is newest.

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "calibrator/motion/log_reader.h"
#include "plumb/parameter_distribution_t.hpp"
#include "tests/process/launch.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Catch::Contains;

constexpr int kIterations = 3;

/// What a log has of a channel, the message that was said first for each key.
template <class Message, class Key>
std::map<int, Message> FirstOf(const fs::path& log, const std::string& wanted, Key key) {
  std::map<int, Message> first;
  ReadLog(log, [&](const std::string& channel, const void* data, int size, int64_t) {
    Message message;
    if (channel == wanted && Decodes(data, size, message)) first.try_emplace(key(message), message);
    return true;
  });
  return first;
}

TEST_CASE("on a worn robot what is lacking is learnt, and what has done best there runs") {
  Stage stage(131, "pendulum", Stage::Time::kReal);
  LearnLittle(stage, 20, 5, "worn.toml");
  const fs::path summary_file = stage.folder / "summary.json", log = stage.folder / "run.lcmlog";
  Child launch =
      Launch(stage, {"--iterations", std::to_string(kIterations), "--evaluation-episodes", "1",
                     "--seed", "3", "--log", log, "--summary", summary_file});
  Finish(stage, launch);

  // The alarm speaks; nothing that the model cannot explain informs its parameters.
  const auto summary = nlohmann::json::parse(Read(summary_file));
  REQUIRE(summary.at("iterations").size() == kIterations);
  for (const auto& iteration : summary.at("iterations")) {
    CHECK_THAT(iteration.at("alarm").get<std::string>(), Contains("cannot explain"));
    CHECK_THAT(iteration.at("gap").get<std::string>(), Contains("the learnt residual explains"));
  }
  const auto distributions = FirstOf<parameter_distribution_t>(
      log, "PARAMETER_DISTRIBUTION", [](const auto& message) { return message.iteration; });
  REQUIRE(distributions.count(kIterations) == 1);
  CHECK(distributions.at(0).num_residuals == 0);
  CHECK(distributions.at(kIterations).num_residuals > 0);

  // Each challenger replaces the incumbent if it is better with three chances in four, and else
  // does not, whatever it was trained on.
  int incumbent = 0;
  for (int k = 0; k < kIterations; ++k) {
    const auto& decision = summary.at("decisions").at(static_cast<size_t>(k));
    INFO(decision.dump());
    CHECK(decision.at("policy") == k);
    if (k == 0) continue;
    CHECK(decision.at("accepted") == (decision.at("probability") > 0.75));
    if (decision.at("accepted")) incumbent = k;
  }
  CHECK(summary.at("policy").at("iteration") == incumbent);
  // It is the incumbent's weights, to the bit, that the robot is judged with.
  const auto newest = FirstOf<policy_t>(log, "POLICY", [](const policy_t& policy) {
    return policy.purpose == policy_t::EVALUATE ? -1 : policy.iteration;
  });
  REQUIRE(newest.count(-1) == 1);
  CHECK(newest.at(-1).trained_in == incumbent);
  CHECK(newest.at(-1).weight == newest.at(incumbent).weight);
  CHECK(newest.at(-1).observation_mean == newest.at(incumbent).observation_mean);
  // (A training that finds nothing better says the policy that it began with.)
  CHECK(newest.at(kIterations - 1).weight != newest.at(0).weight);
}

}  // namespace
}  // namespace plumb
