#include "dashboard/gateway.h"

#include <algorithm>
#include <catch2/catch.hpp>

#include "plumb/estimator_status_t.hpp"
#include "tests/dashboard/gateway_stand.h"

namespace plumb {
namespace {

using nlohmann::json;

TEST_CASE(
    "whoever comes late hears of each update, in order, and since when things are as they are") {
  Stand stand;
  for (const int update : {1, 2, 3, 3, 3, 4}) {
    stand.Hear("TRAINING_STATUS", Training(1, update));
    stand.Hear("DRIVER_STATUS", Driver(driver_status_t::IDLE, update));
  }
  stand.Hear("DRIVER_STATUS", Driver(driver_status_t::ARMED, 4));
  stand.Hear("DRIVER_STATUS", Driver(driver_status_t::ARMED, 4, "why"));
  training_status_t last = Training(1, 4);
  last.complete = true;
  stand.Hear("TRAINING_STATUS", last);
  stand.Listen("TRAINING_STATUS");
  stand.looker.Take();
  std::vector<int> updates;
  for (const auto& heard : stand.looker.heard) updates.push_back(heard.json["update"]);
  CHECK(updates == std::vector<int>{1, 2, 3, 4, 4});
  CHECK(stand.looker.heard.back().json["complete"] == true);
  stand.Listen("DRIVER_STATUS");
  stand.looker.Take();
  std::vector<int> answered;
  for (size_t i = 5; i < stand.looker.heard.size(); ++i)
    answered.push_back(stand.looker.heard[i].json["answered"]);
  CHECK(answered == std::vector<int>{1, 4, 4, 4});  // of those that are alike the first, the newest
}

TEST_CASE("whoever comes while time stands still sees where the robot is") {
  Stand stand;
  stand.Hear("ROBOT_STATE", State(1, 0.5));
  stand.Hear("ROBOT_STATE", State(2, 0.75));
  stand.Listen("ROBOT_STATE");
  stand.Listen("PLUMB_SCENE");
  stand.Listen("JOINT_STATE");  // of which nothing has been heard
  stand.looker.Take();
  REQUIRE(stand.looker.heard.size() == 2);
  CHECK(stand.looker.heard[0].json["q"] == json{0.75});
  CHECK(stand.looker.heard[0].utime == State(2).utime);
  CHECK(stand.looker.heard[1].json["entities"][1]["id"] == "robot");
}

TEST_CASE("what is no longer kept is not kept for who was slow to fetch it either") {
  Stand stand;
  const auto say = [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      estimator_status_t estimator{};
      estimator.reason = std::to_string(i);
      stand.Hear("ESTIMATOR_STATUS", estimator);
    }
  };
  say(0, History::kMaxMessages);
  stand.Listen("ESTIMATOR_STATUS");
  say(History::kMaxMessages, 2 * History::kMaxMessages - 1);
  stand.looker.Take();
  REQUIRE(stand.looker.heard.size() == History::kMaxMessages);
  CHECK(stand.looker.heard[0].json["reason"] == std::to_string(History::kMaxMessages - 1));
  CHECK(stand.looker.heard[1].json["reason"] == std::to_string(History::kMaxMessages));
}

TEST_CASE("a run that begins anew is a page that begins anew") {
  Stand stand;
  for (const int iteration : {1, 2, 3, 1}) stand.Hear("TRAINING_STATUS", Training(iteration, 1));
  stand.Listen("TRAINING_STATUS");
  stand.looker.Take();
  REQUIRE(stand.looker.heard.size() == 1);
  CHECK(stand.looker.heard[0].json["iteration"] == 1);
}

TEST_CASE("a run that goes on from one of its iterations keeps those before it") {
  Stand stand;
  int64_t utime = kUtime;
  for (const auto& [iteration, update] : {std::pair(1, 1), {2, 1}, {2, 2}, {3, 1}, {2, 1}}) {
    training_status_t status = Training(iteration, update);
    status.utime = ++utime;
    stand.Hear("TRAINING_STATUS", status);
  }
  stand.Listen("TRAINING_STATUS");
  stand.looker.Take();
  std::vector<int> iterations;
  for (const auto& heard : stand.looker.heard) iterations.push_back(heard.json["iteration"]);
  CHECK(iterations == std::vector<int>{1, 2});
}

TEST_CASE("what was said later than where a log is set back to has not been said yet") {
  Stand stand;
  stand.Listen("PLUMB_GATEWAY");
  const auto play = [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      stand.Hear("ROBOT_STATE", State(i));
      estimator_status_t estimator{};
      estimator.reason = std::to_string(i);
      stand.Hear("ESTIMATOR_STATUS", estimator);  // which does not tell the time
      driver_status_t driver = Driver(driver_status_t::IDLE, 0, std::to_string(i));
      driver.utime = State(i).utime - 2000;  // a little behind the states, which sets nothing back
      stand.Hear("DRIVER_STATUS", driver);
    }
  };
  const auto late = [&](const std::string& topic) {
    Looker looker;
    stand.gateway.Join(looker.viewer);
    looker.Take();
    stand.gateway.OnText(looker.viewer, looker.Subscription(topic));
    looker.Take();
    std::vector<std::string> reasons;
    for (const auto& heard : looker.heard) reasons.push_back(heard.json["reason"]);
    stand.gateway.Leave(looker.viewer);
    return reasons;
  };
  play(0, 40);
  play(20, 25);
  stand.Pass(1'000'000);
  std::vector<std::string> expected;
  for (int i = 0; i < 25; ++i) expected.push_back(std::to_string(i));
  CHECK(late("ESTIMATOR_STATUS") == expected);
  CHECK(late("DRIVER_STATUS") == expected);
  stand.looker.Take();
  CHECK(stand.looker.heard.back().json["rewinds"] == 1);
  CHECK(stand.looker.heard.back().json["utime"] == State(24).utime);
  play(0, 1);
  play(0, 1);  // the same once more is nothing else
  stand.Pass(1'000'000);
  CHECK(late("ESTIMATOR_STATUS") == std::vector<std::string>{"0"});
  stand.looker.Take();
  CHECK(stand.looker.heard.back().json["rewinds"] == 2);
}

}  // namespace
}  // namespace plumb
