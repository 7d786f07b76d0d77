// A robot that no simulator of ours contains, through the whole loop: what the model lacks is
// learnt beside its parameters, and the robot runs what has done best on it, not what is newest.

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "common/lcm_log_reader.h"
#include "plumb/parameter_distribution_t.hpp"
#include "tests/process/launch.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Catch::Contains;

constexpr double kLong = 1200;  // [s] of real time: whoever is as late as that hangs
constexpr int kIterations = 3;

/// What a log has of a channel, the message that was said first for each key.
template <class Message, class Key>
std::map<int, Message> FirstOf(const fs::path& log, const std::string& channel, Key key) {
  LcmLogReader reader(log);
  LcmLogEvent event;
  std::map<int, Message> first;
  while (reader.Read(event)) {
    Message message;
    if (event.channel != channel) continue;
    REQUIRE(message.decode(event.data.data(), 0, static_cast<int>(event.data.size())) > 0);
    first.try_emplace(key(message), message);
  }
  return first;
}

TEST_CASE("on a worn robot what is lacking is learnt, and what has done best there runs") {
  Stage stage(131, "pendulum", Stage::Time::kReal);
  const fs::path file = stage.folder / "robot.toml";
  std::ofstream(file) << fmt::format(
      "extends = \"{0}/worn.toml\"\n[robot]\nurdf = \"{0}/robot.urdf\"\n[training]\nupdates = "
      "20\nupdates_again = 5\n",
      stage.robot_folder);
  stage.robot_folder = file;
  const fs::path summary_file = stage.folder / "summary.json", log = stage.folder / "run.lcmlog";
  Child launch =
      Launch(stage, {"--iterations", std::to_string(kIterations), "--evaluation-episodes", "1",
                     "--seed", "3", "--log", log, "--summary", summary_file});
  stage.WaitUntil([&] { return !launch.running(); }, kLong);
  INFO(launch.Tail(30));
  REQUIRE_FALSE(launch.running());
  REQUIRE_FALSE(launch.failed());

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
