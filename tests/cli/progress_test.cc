#include "cli/progress.h"

#include <malloc.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>

#include "plumb/policy_t.hpp"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

calibration_status_t Calibration(int iteration) {
  calibration_status_t c{};
  c.iteration = iteration;
  c.num_parameters = 3;
  c.mean = {10.2, 1.1, 1.05}, c.sd = {0.4, 0.08, 0.04};
  c.horizon = {1, 5, 20}, c.error_before = {0.003, 0.01, 0.2},
  c.error_after = c.error_prior = c.error_before;
  c.num_horizons = 3;
  c.combination = {"gravity / length", "mass length^2"};
  c.num_combinations = 2;
  c.combination_power = {1, 0, -1, 0, 1, 2};
  c.num_powers = 6;
  c.combination_mean = {9.5, 1.3}, c.combination_sd = {0.01, 0.003};
  c.discrepancy = 0.5, c.kl = 0.4, c.ess = 21;
  c.identifiability = "only gravity / length and mass length^2 can be known";
  return c;
}

struct Fixture {
  RobotDescription robot = LoadPendulum("robot.toml");
  Progress progress{robot, 2};

  void Rollout(int iteration, int8_t purpose, std::vector<double> returns) {
    controller_status_t s{};
    s.phase = controller_status_t::COMPLETE;
    s.policy_iteration = iteration;
    s.purpose = purpose;
    s.returns = std::move(returns);
    s.num_episodes = static_cast<int>(s.returns.size());
    progress.OnController(s);
  }
  void Trained(int iteration, double simulated) {
    training_status_t t{};
    t.iteration = iteration, t.updates = t.update = 60, t.complete = 1,
    t.evaluation_return = simulated;
    progress.OnTraining(t);
  }
};

TEST_CASE_METHOD(
    Fixture, "a row shows the distribution beside the returns of the policy it was learned from") {
  Trained(0, -210);
  Rollout(0, policy_t::CALIBRATE, {-300});
  progress.Account(12.5, 1.25);
  progress.OnCalibration(Calibration(1));
  progress.OnCalibration(Calibration(1));  // repeated at 1 Hz
  const auto rows = progress.TakeRows();
  REQUIRE(rows.size() == 1);
  for (const char* text : {"   1", "10.200 ± 0.400", "0.50", "0.0030", "0.2000", "0.400", "21.0",
                           "-210", "-300", "12.5"}) {
    CHECK_THAT(rows[0], Catch::Contains(text));
  }
  CHECK(progress.TakeRows().empty());
  CHECK_THAT(progress.Header(), Catch::Contains("gravity [m/s^2]") && Catch::Contains("20-step"));
}

TEST_CASE_METHOD(Fixture, "only the final policy's evaluation ends the run") {
  Rollout(1, policy_t::CALIBRATE, {-200});
  CHECK_FALSE(progress.finished());
  Rollout(2, policy_t::EVALUATE, {-100, -200, -120});
  CHECK(progress.finished());
}

TEST_CASE_METHOD(Fixture, "what was learned stands beside the truth, combinations first") {
  Trained(0, -210);
  Rollout(0, policy_t::CALIBRATE, {-300});
  progress.OnCalibration(Calibration(1));
  Rollout(2, policy_t::EVALUATE, {-100, -200, -120, -180});
  const Eigen::Vector3d truth(10, 1, 1.1);
  const std::string text = progress.Conclusion(truth);
  // 10 / 1.1 = 9.0909, 1 * 1.1^2 = 1.21
  for (const char* part : {"9.091", "4.50 %", "1.210", "7.44 %",
                           "mean return -150, median -150, worst -200", "only gravity"}) {
    CHECK_THAT(text, Catch::Contains(part));
  }
  const nlohmann::json summary = progress.Summary(truth);
  CHECK(summary["hidden"] == nlohmann::json({10, 1, 1.1}));
  CHECK(summary["iterations"][0]["combinations"][1]["hidden"].get<double>() == Approx(1.21));
  CHECK(summary["iterations"][0]["robot_return"] == -300);
  CHECK(summary["evaluation_returns"].size() == 4);
  // A later iteration may find the same combinations in another order.
  calibration_status_t later = Calibration(2);
  later.combination = {"mass length^2", "gravity / length"};
  later.combination_power = {0, 1, 2, 1, 0, -1};
  progress.OnCalibration(later);
  const nlohmann::json iterations = progress.Summary(truth)["iterations"];
  CHECK(iterations[0]["combinations"][1]["hidden"].get<double>() == Approx(1.21));
  CHECK(iterations[1]["combinations"][0]["hidden"].get<double>() == Approx(1.21));
  // with a real robot nobody knows the truth
  CHECK(progress.Summary({})["hidden"].is_null());
  CHECK(progress.Conclusion({}).find('%') == std::string::npos);
}

TEST_CASE_METHOD(Fixture, "a run that only calibrates ends with what the alarm says") {
  calibration_status_t status = Calibration(1);
  status.alarm = "the model cannot explain this log: pivot, free";
  Progress calibrates(robot, 1, true);
  calibrates.OnCalibration(status);
  CHECK(calibrates.finished());
  CHECK_THAT(calibrates.Conclusion({}),
             Catch::Contains("can be known.\nthe model cannot explain this log: pivot, free\n"));
  progress.OnCalibration(status);  // a decision on a policy follows
  CHECK_THAT(progress.Conclusion({}), !Catch::Contains("cannot explain"));
  status.alarm.clear();
  Progress explained(robot, 1, true);
  explained.OnCalibration(status);
  CHECK_THAT(explained.Conclusion({}), Catch::Contains("can be known.\ntime: "));
}

TEST_CASE_METHOD(
    Fixture,
    "the run's clock is told apart from real time, and only the former is in the summary") {
  controller_status_t c{};
  c.phase = controller_status_t::RUNNING;
  progress.OnController(c);
  progress.Account(60, 4);
  c.phase = controller_status_t::WAITING;
  progress.OnController(c);
  training_status_t t{};
  t.updates = 60;
  progress.OnTraining(t);
  progress.Account(60, 11);
  CHECK_THAT(progress.Conclusion({}),
             Catch::Contains("time: 60 s on the robot, by its clock; 11 s in all: 4 s on the "
                             "robot, 7 s training, 0 s for the rest"));
  const auto seconds = progress.Summary({})["seconds"];
  CHECK(seconds["robot"] == 60);
  CHECK(seconds["training"] == 0);
  CHECK(seconds["total"] == 60);
}

TEST_CASE_METHOD(Fixture, "which policy runs, since when, and why") {
  CHECK(progress.Summary({})["policy"].is_null());
  controller_status_t s{};
  s.phase = controller_status_t::COMPLETE;
  s.purpose = policy_t::CALIBRATE;
  s.num_episodes = s.episodes_wanted = 2;
  s.returns = {-300, -90}, s.steps = {100, 100}, s.late_rate = {-2, -1}, s.fell = {0, 0};
  progress.OnController(s);
  progress.OnCalibration(Calibration(1));
  training_status_t t{};
  t.iteration = 1, t.updates = 60;
  t.incumbent = 0, t.incumbent_since = 0, t.challenger = 0, t.probability = 0;
  t.challenger_return = t.incumbent_return = -500;
  t.decision = "policy 0 is the first (-500)";
  progress.OnTraining(t);
  progress.OnTraining(t);  // repeated
  auto rows = progress.TakeRows();
  REQUIRE(rows.size() == 2);
  CHECK_THAT(rows[0], Catch::Contains("-500"));  // -300, and 100 steps more at -2
  CHECK_THAT(rows[1], Catch::Contains(t.decision));
  CHECK_THAT(progress.StatusLine(3), Catch::Contains("; policy 0 runs"));

  t.challenger = 1, t.probability = 0.25, t.challenger_return = -700;
  t.decision = "policy 1 not accepted (-700; incumbent 0: -500; better with 25 %)";
  progress.OnTraining(t);
  rows = progress.TakeRows();
  REQUIRE(rows.size() == 1);
  CHECK_THAT(rows[0], Catch::Contains(t.decision));
  CHECK_THAT(
      progress.Conclusion({}),
      Catch::Contains("policy 0 runs since iteration 0: policy 0 is the first (-500); "
                      "policy 1 not accepted (-700; incumbent 0: -500; better with 25 %)\n"));
  const nlohmann::json summary = progress.Summary({});
  CHECK(summary["iterations"][0]["robot_return"] == -500);
  CHECK(summary["policy"]["iteration"] == 0);
  CHECK(summary["policy"]["since"] == 0);
  REQUIRE(summary["decisions"].size() == 2);
  CHECK(summary["decisions"][0]["accepted"] == true);
  CHECK(summary["decisions"][1]["accepted"] == false);
  CHECK(summary["decisions"][1]["policy"] == 1);
  CHECK(summary["decisions"][1]["probability"] == 0.25);
  CHECK(summary["decisions"][1]["return"] == -700);
  CHECK(summary["decisions"][1]["incumbent_return"] == -500);
  CHECK(summary["decisions"][1]["summary"] == t.decision);
}

TEST_CASE_METHOD(Fixture, "messages whose sizes do not fit are ignored") {
  calibration_status_t hostile = Calibration(1);
  hostile.num_powers = 2, hostile.combination_power = {1, 2};
  progress.OnCalibration(hostile);
  hostile = Calibration(2'000'000'000);
  progress.OnCalibration(hostile);
  CHECK(progress.TakeRows().empty());
  progress.OnCalibration(Calibration(1));
  const auto rows = progress.TakeRows();
  REQUIRE(rows.size() == 1);
  // returns of before a resumption are not known: a dash
  CHECK(rows[0].find("nan") == std::string::npos);
}

TEST_CASE_METHOD(Fixture, "the status line says what is waited for") {
  training_status_t t{};
  t.updates = 60, t.update = 7;
  progress.OnTraining(t);
  CHECK_THAT(progress.StatusLine(3), Catch::Contains("training policy 0: update 7/60"));
  CHECK_THAT(progress.StatusLine(3), !Catch::Contains("dropped"));
  t.dropped_episodes = 12;
  progress.OnTraining(t);
  CHECK_THAT(progress.StatusLine(3), Catch::Contains(", 12 episodes dropped"));
  CHECK(progress.Summary({})["dropped_episodes"] == 12);
  driver_status_t d{};
  d.state = driver_status_t::FAULT;
  d.reason = "no command for 250 ms";
  progress.OnDriver(d);
  CHECK_THAT(progress.StatusLine(3), Catch::Contains("FAULT: no command for 250 ms"));
}

TEST_CASE_METHOD(Fixture, "of policies that the run does not have nothing is remembered") {
  const size_t before = mallinfo2().uordblks;
  for (int i = 3; i < 100'000; ++i) {
    Rollout(i, policy_t::CALIBRATE, {1});
    Rollout(-i, policy_t::CALIBRATE, {1});
    Trained(i, 1);
    Trained(-i, 1);
  }
  CHECK(mallinfo2().uordblks - before < 10'000);
}

TEST_CASE_METHOD(Fixture, "what others say is shown without what would control the terminal") {
  driver_status_t driver{};
  driver.state = driver_status_t::FAULT;
  driver.reason = "\x1b[2Jcable\noff\xff";
  progress.OnDriver(driver);
  const std::string bad = "\xef\xbf\xbd";
  CHECK_THAT(progress.StatusLine(1), Catch::Contains("FAULT: " + bad + "[2Jcable off" + bad));
  calibration_status_t status = Calibration(1);
  status.combination[0] = "gravity\xff", status.gap = "\x1b]0;title\x07";
  status.identifiability = "\xc3", status.alarm = "\xed\xa0\x80";
  progress.OnCalibration(status);
  CHECK(progress.TakeRows()[1] == "      " + bad + "]0;title" + bad);
  CHECK_NOTHROW(progress.Summary({}).dump());  // valid UTF-8
  CHECK_THAT(progress.Conclusion({}), !Catch::Contains("\xff"));
}

}  // namespace
}  // namespace plumb
