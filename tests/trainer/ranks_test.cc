// Training on several ranks, as mpirun starts them.
#include "common/ranks.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <stdexcept>

#include "tests/mpirun.h"
#include "tests/temporary_folder.h"
#include "tests/trainer/pendulum.h"
#include "trainer/trainer.h"

namespace plumb {
namespace {

/// Ends early when it turns fast; some of its simulators cannot be.
class FragilePendulum : public GymPendulum {
 public:
  void Reset(const SimulatorDraw& simulator, Random& random) override {
    if (simulator.parameters[0] < 9.2) throw std::invalid_argument("no such simulator");
    GymPendulum::Reset(simulator, random);
  }
  StepResult Step(const Eigen::Ref<const Eigen::VectorXf>& action) override {
    StepResult result = GymPendulum::Step(action);
    Eigen::VectorXf observation(3);
    Observe(observation);
    result.terminated = std::abs(observation[2]) > 5;
    return result;
  }
};

Eigen::VectorXd RandomGravity(Random& random) {
  return Eigen::Vector3d(random.Uniform(9, 11), 1, 1);
}

/// All that a few updates come to.
std::vector<double> Train(const Ranks& ranks, int threads) {
  TrainingSettings settings = PendulumSettings();
  settings.batch = 2000;
  settings.hidden = {24, 20};
  settings.normalise_observations = true;
  settings.worst_share = .7;
  settings.worst_after = 10;
  Trainer trainer(
      settings, [] { return std::make_unique<FragilePendulum>(); }, Eigen::VectorXd::Constant(1, 2),
      11, threads, ranks);
  std::vector<double> results;
  for (int i = 0; i < 3; ++i) {
    const UpdateReport report = trainer.Update(RandomGravity);
    REQUIRE(report.step.accepted);
    REQUIRE(report.dropped_episodes > 0);
    results.insert(results.end(),
                   {report.step.kl, report.step.surrogate_gain, report.mean_return,
                    report.explained_variance, 1. * report.batch, 1. * report.dropped_episodes});
  }
  const TrainerState state = trainer.state();
  const auto append = [&](const auto& values) {
    results.insert(results.end(), values.begin(), values.end());
  };
  append(state.policy.parameters);
  append(state.policy.observation_mean);
  append(state.policy.observation_scale);
  append(state.critic.parameters);
  append(state.critic.second_moment);
  results.push_back(trainer.Evaluate(RandomGravity, 7).mean);
  return results;
}

std::string Environment(const char* name) {
  const char* value = std::getenv(name);
  REQUIRE(value);
  return value;
}

// Run by each of several ranks.
TEST_CASE("train as one of several ranks", "[.train]") {
  const Ranks ranks;
  const std::vector<double> results = Train(ranks, std::stoi(Environment("PLUMBLINE_THREADS")));
  const std::string text(reinterpret_cast<const char*>(results.data()),
                         results.size() * sizeof(double));
  std::ofstream(Environment("PLUMBLINE_RESULTS") + std::to_string(ranks.rank()), std::ios::binary)
      << text;
}

TEST_CASE("Training is the same bits for any number of ranks and threads") {
  if (!HaveMpirun()) return;
  const std::vector<double> alone = Train(Ranks::Alone(), 1);
  const std::string expected(reinterpret_cast<const char*>(alone.data()),
                             alone.size() * sizeof(double));
  for (const auto& [ranks, threads] : {std::pair{1, 2}, {2, 1}, {3, 2}, {4, 1}}) {
    const TemporaryFolder folder;
    const Outcome outcome = Shell("PLUMBLINE_THREADS=" + std::to_string(threads) +
                                  " PLUMBLINE_RESULTS=" + folder / "of_rank_" + " " +
                                  Mpirun(ranks, HiddenTest("train")));
    INFO(ranks << " ranks of " << threads << " threads: " << outcome.text);
    REQUIRE(outcome.status == 0);
    for (int r = 0; r < ranks; ++r)
      CHECK(Read(folder / "of_rank_" + std::to_string(r)) == expected);
  }
}

// Run by each of two ranks.
TEST_CASE("train from another beginning than the other rank", "[.apart]") {
  const Ranks ranks;
  const auto seed = static_cast<uint64_t>(1 + ranks.rank());
  Trainer trainer(PendulumSettings(), MakeGymPendulum, Eigen::VectorXd::Constant(1, 2), seed, 1,
                  ranks);
  CHECK_THROWS_WITH(trainer.Update(GymParameters),
                    Catch::Contains("rank 1 has come to another policy"));
}

TEST_CASE("Ranks that come to different results say so") {
  if (!HaveMpirun()) return;
  const Outcome outcome = Shell(Mpirun(2, HiddenTest("apart")));
  INFO(outcome.text);
  CHECK(outcome.status == 0);
}

}  // namespace
}  // namespace plumb
