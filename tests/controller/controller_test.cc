// Which episodes a controller runs, and what it does in them.
#include <cmath>
#include <map>
#include <set>
#include <vector>

#include "tests/controller/surroundings.h"

namespace plumb {
namespace {

TEST_CASE_METHOD(Surroundings, "a table of efforts is played once, without any policy") {
  Eigen::MatrixXf actions(7, 1);
  actions << 0.5, -1, 0.25, 0, 1, -0.5, 0.125;
  controller.Play(actions);
  CHECK_NOTHROW(controller.OnPolicy(Policy(1)));  // nobody asks for one
  Driver(driver_state);
  std::vector<double> efforts;
  for (int i = 0; i < 1000 && controller.phase() != S::COMPLETE; ++i) {
    const auto command = Step();
    if (command && command->step >= 0) efforts.push_back(command->effort[0]);
  }
  REQUIRE(controller.phase() == S::COMPLETE);
  REQUIRE(efforts.size() == 7);
  for (Eigen::Index i = 0; i < 7; ++i)
    CHECK(efforts[static_cast<size_t>(i)] == 2. * static_cast<double>(actions(i, 0)));  // [Nm]
  CHECK(controller.status().purpose == policy_t::CALIBRATE);
  CHECK(controller.status().num_episodes == 1);
  CHECK(controller.status().steps == std::vector<int>{7});
  for (int i = 0; i < 100; ++i) {  // and not again
    const auto command = Step();
    if (command) CHECK(command->effort[0] == 0);
  }
}

TEST_CASE_METHOD(Surroundings, "an episode has its number of steps, one control period apart") {
  Driver(driver_status_t::ARMED);
  controller.OnPolicy(Policy(3, 2, 0.25f));
  std::vector<joint_command_t> commands;
  for (int i = 0; i < 10'000 && controller.phase() != S::COMPLETE; ++i) {
    const auto command = Step();
    if (command && command->episode >= 0) commands.push_back(*command);
  }
  REQUIRE(controller.phase() == S::COMPLETE);
  REQUIRE(commands.size() == 400);
  for (size_t i = 0; i < commands.size(); ++i) {
    CHECK(commands[i].step == static_cast<int>(i % 200));
    CHECK(commands[i].effort[0] == Approx(0.5));  // action 0.25 of 2 Nm
    CHECK(commands[i].policy_iteration == 3);
    if (i % 200 > 0) CHECK(commands[i].state_sequence == commands[i - 1].state_sequence + 10);
  }
  const S& status = controller.status();
  REQUIRE(status.num_episodes == 2);
  CHECK(status.first_state_sequence[0] == commands[0].state_sequence);
  CHECK(status.last_state_sequence[0] == commands[199].state_sequence + 10);
  CHECK(status.episode[1] == commands[200].episode);
  // gym's reward at a state held still: theta^2 + 0.1 w^2 + 0.001 u^2, summed
  const double q = robot_state.q[0], v = robot_state.v[0];
  CHECK(status.returns[1] == Approx(-200 * (q * q + 0.1 * v * v + 0.001 * 0.25)));
}

TEST_CASE_METHOD(Surroundings, "a roll-out begins with a trial, without exploration") {
  Driver(driver_status_t::ARMED);
  policy_t policy = Policy(3, 2, 0.25f, policy_t::CALIBRATE);
  policy.trial_steps = 80;
  controller.OnPolicy(policy);
  std::map<int64_t, std::vector<double>> efforts;  // by episode
  for (int i = 0; i < 10'000 && controller.phase() != S::COMPLETE; ++i) {
    const auto command = Step();
    if (command && command->episode >= 0) efforts[command->episode].push_back(command->effort[0]);
  }
  REQUIRE(controller.phase() == S::COMPLETE);
  REQUIRE(efforts.size() == 2);
  const std::vector<double>&trial = efforts.begin()->second, &rest = efforts.rbegin()->second;
  CHECK(trial == std::vector<double>(80, 0.5));  // action 0.25 of 2 Nm, each time
  REQUIRE(rest.size() == 120);                   // of 200
  CHECK(std::set<double>(rest.begin(), rest.end()).size() > 60);
  const S& status = controller.status();
  CHECK(status.num_episodes == 2);
  CHECK(status.steps == std::vector<int32_t>{80, 120});
  CHECK(status.fell == std::vector<int8_t>{0, 0});
  REQUIRE(status.episode.size() == 2);
  CHECK(status.episode[0] == efforts.begin()->first);
  // The robot is held still: each step of the trial pays the same.
  REQUIRE(status.late_rate.size() == 2);
  CHECK(status.late_rate[0] == Approx(status.returns[0] / 80));
}

TEST_CASE_METHOD(Surroundings, "nothing but a roll-out to calibrate with has a trial") {
  Driver(driver_status_t::ARMED);
  policy_t policy = Policy(3, 2, 0.25f, policy_t::EVALUATE);
  policy.trial_steps = 80;
  controller.OnPolicy(policy);
  StepUntil(S::COMPLETE);
  CHECK(controller.status().steps == std::vector<int32_t>{200, 200});
}

TEST_CASE_METHOD(
    Surroundings,
    "a return is that of the steps taken: each is paid when the state after it is there") {
  Driver(driver_status_t::ARMED);
  controller.OnPolicy(Policy(0, 1, 0.25f));
  StepUntil(S::RUNNING);
  double expected = 0;
  int steps = 0;
  const auto task = MakeTask(robot);
  Eigen::VectorXd q, v, effort, next_q, next_v;
  const auto map = [](const std::vector<double>& values) {
    return Eigen::Map<const Eigen::VectorXd>(values.data(), 1);
  };
  q = map(robot_state.q), v = map(robot_state.v), effort = Eigen::VectorXd::Constant(1, 0.5);
  for (int i = 1; controller.phase() == S::RUNNING; ++i) {
    robot_state.q[0] += 0.01, robot_state.v[0] -= 0.02;
    Step();
    if (i % 10 != 0) continue;
    next_q = map(robot_state.q), next_v = map(robot_state.v);
    expected += task->Reward(q, v, effort, next_q, next_v);
    q = next_q, v = next_v;
    CHECK(controller.status().episode_return == Approx(expected));
    ++steps;
  }
  CHECK(steps == 200);
  CHECK(controller.status().returns.at(0) == Approx(expected));
}

TEST_CASE_METHOD(Surroundings, "a new policy waits for the end of the episode") {
  Driver(driver_status_t::ARMED);
  controller.OnPolicy(Policy(0));
  StepUntil(S::RUNNING);
  controller.OnPolicy(Policy(1));
  for (int i = 0; i < 100; ++i) Step();
  CHECK(controller.status().policy_iteration == 0);
  StepUntil(S::WAITING);
  CHECK(controller.status().policy_iteration == 1);
  CHECK(controller.status().num_episodes == 0);
}

TEST_CASE_METHOD(Surroundings, "a policy that is repeated is not run again") {
  Driver(driver_status_t::ARMED);
  policy_t policy = Policy(0);
  controller.OnPolicy(policy);
  StepUntil(S::COMPLETE);
  policy.utime += 1'000'000;
  controller.OnPolicy(policy);
  CHECK(controller.phase() == S::COMPLETE);
  SECTION("another one is") { controller.OnPolicy(Policy(1)); }
  SECTION("one with another normaliser is not a repeat") {
    policy.observation_mean[0] += 1;
    controller.OnPolicy(policy);
  }
  SECTION("nor one of which more episodes are wanted") {
    policy.episodes += 1;
    controller.OnPolicy(policy);
    CHECK(controller.status().episodes_wanted == 2);
  }
  CHECK(controller.phase() == S::WAITING);
}

TEST_CASE_METHOD(Surroundings, "a policy that does not fit is refused and the old one stays") {
  Driver(driver_status_t::ARMED);
  controller.OnPolicy(Policy(0));
  policy_t wrong = GaussianPolicy(PolicyShape{5, {4}, 1}).ToMessage();
  wrong.iteration = 1;
  wrong.episodes = 1;
  CHECK_THROWS_AS(controller.OnPolicy(wrong), std::invalid_argument);
  policy_t poisoned = Policy(1);
  poisoned.weight[0] = std::numeric_limits<float>::quiet_NaN();
  CHECK_THROWS_AS(controller.OnPolicy(poisoned), std::invalid_argument);
  policy_t stronger = Policy(1);
  stronger.action_scale = {3};
  CHECK_THROWS_AS(controller.OnPolicy(stronger), std::invalid_argument);
  CHECK(controller.status().policy_iteration == 0);
}

TEST_CASE_METHOD(Surroundings, "a robot that nobody can place rests, and begins where it is") {
  Controller resting(robot, 1, 2.0);
  driver_status_t armed{};
  armed.state = driver_status_t::ARMED;
  resting.OnDriverStatus(armed, now);
  resting.OnPolicy(Policy(0, 1, 0.5f));
  robot_state.q = {3.1};
  int zeros = 0;
  for (int64_t begin = now; resting.phase() != S::RUNNING;) {
    now += 5000, utime += 5000;
    ++robot_state.sequence;
    robot_state.utime = utime;
    resting.OnDriverStatus(armed, now);
    const auto command = resting.OnState(robot_state, now, utime);
    CHECK_FALSE(resting.place());
    if (command && command->episode < 0) ++zeros;
    REQUIRE(now - begin < 3'000'000);
  }
  CHECK(zeros >= 38);  // two seconds of zero effort, twenty times a second
  CHECK(zeros <= 42);
}

TEST_CASE_METHOD(Surroundings, "the same seed places the robot in the same states") {
  Driver(driver_status_t::ARMED);
  controller.OnPolicy(Policy(0, 3));
  Surroundings other;
  other.Driver(driver_status_t::ARMED);
  other.controller.OnPolicy(Policy(0, 3));
  StepUntil(S::RUNNING);
  other.StepUntil(S::RUNNING);
  CHECK(robot_state.q == other.robot_state.q);
  CHECK(robot_state.v == other.robot_state.v);
}

}  // namespace
}  // namespace plumb
