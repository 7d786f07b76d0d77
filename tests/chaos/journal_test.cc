// What the journal's witness demands: every episode that the calibrator was told is complete.

#include <catch2/catch.hpp>
#include <cstdlib>

#include "calibrator/live/calibrator.h"
#include "calibrator/live/checkpoint.h"
#include "calibrator/results/posterior_file.h"
#include "chaos/journal_witness.h"
#include "chaos/little_robot.h"
#include "common/identity.h"
#include "common/lockstep/participant.h"
#include "common/message_bytes.h"
#include "plumb/controller_status_t.hpp"
#include "plumb/driver_status_t.hpp"
#include "plumb/policy_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

constexpr char kBus[] = "loop:";
constexpr uint64_t kSeed = 1;

RobotDescription PendulumRobot() {
  const char* const source = std::getenv("PLUMBLINE_SOURCE");
  return LoadRobot(std::string(source ? source : ".") + "/robots/pendulum");
}

/// A calibrator that was told that two episodes are complete, of which no transition can be used.
struct Told {
  Told() {
    driver.Lead(robot.name, kBus);
    witness.OnStart(driver.beginning() - 1);
    Hear("DRIVER_STATUS", driver_status_t{});
    robot_state_t state{};
    state.num_positions = state.num_velocities = 1;
    state.q = state.v = state.q_sd = state.v_sd = state.effort = {0};
    Hear("ROBOT_STATE_SMOOTHED", state);
    controller_status_t status{};
    status.phase = controller_status_t::COMPLETE;
    status.purpose = policy_t::CALIBRATE;
    status.num_episodes = status.episodes_wanted = 2;
    status.episode = {7, 8};
    status.first_state_sequence = status.last_state_sequence = {0, 0};
    status.returns = status.late_rate = {0, 0};
    status.steps = {1, 1};
    status.fell = {0, 0};
    Hear("CONTROLLER_STATUS", status);
  }
  template <class Message>
  void Hear(const std::string& channel, const Message& message) {
    lockstep_post_t post;
    post.topic = ChannelTopic(channel);
    post.arrival = driver.Now();
    post.data = Encode(message);
    post.data.resize(post.data.size() + kSealSize);
    driver.Seal(channel, post.data);
    post.size = static_cast<int32_t>(post.data.size());
    witness.OnHeard(post);
  }
  /// It calibrates with the roll-outs of these episodes. @return the invariant that it violates.
  int Calibrate(const std::vector<int64_t>& episodes) {
    SimOpt simopt(robot, kSeed, 1, robot.calibration.method);
    std::vector<Rollout> rollouts;
    for (const int64_t episode : episodes) rollouts.push_back({episode, 0, {}});
    simopt.Begin(std::move(rollouts));
    std::optional<CalibrationReport> report;
    while (simopt.running()) report = simopt.Update();
    CalibrationCheckpoint(folder.path(), robot, kSeed).Save(simopt.state());
    WritePosterior(folder.path() / "posterior_1.json", IterationFindings(robot, simopt, *report),
                   robot, {});
    witness.Judge(1, folder.path(), kSeed, said);
    return chronicle.invariant();
  }

  const RobotDescription robot = PendulumRobot();
  const TemporaryFolder folder;
  const SigningKey key{MakeKnownKey(folder.path() / "key", kSeed, 1)};
  Identity driver{"plumb-driver", key, Clock(), Identity::Reach::kRun, 0};
  Chronicle chronicle;
  MessageWitness said{chronicle};
  JournalWitness witness{robot, kBus, key, chronicle};
};

TEST_CASE("each episode that was completed is in the journal, in its place, once") {
  Told told;
  SECTION("as it was told") { CHECK(told.Calibrate({7, 8}) == 0); }
  SECTION("the last is missing") { CHECK(told.Calibrate({7}) == 4); }
  SECTION("the first is missing") { CHECK(told.Calibrate({8}) == 4); }
  SECTION("all are missing") { CHECK(told.Calibrate({}) == 4); }
  SECTION("one counts twice") { CHECK(told.Calibrate({7, 8, 8}) == 4); }
  SECTION("one that it was not told of") { CHECK(told.Calibrate({7, 9}) == 4); }
}

TEST_CASE("a distribution that was said rests on a journal") {
  Told told;
  lockstep_post_t post;
  post.topic = ChannelTopic("PARAMETER_DISTRIBUTION");
  parameter_distribution_t distribution{};
  distribution.iteration = 1;
  post.data = Encode(distribution);
  told.said.OnSaid(1, post, "plumb-calibrator");
  told.witness.Judge(1, told.folder.path(), kSeed, told.said);
  CHECK(told.chronicle.invariant() == 4);
}

}  // namespace
}  // namespace plumb
