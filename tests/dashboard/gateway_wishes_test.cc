#include "dashboard/gateway.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <limits>

#include "tests/dashboard/gateway_stand.h"

namespace plumb {
namespace {

using nlohmann::json;

TEST_CASE("an emergency stop goes to the driver at once, and is done when the driver says so") {
  Stand stand({{}, false, 100, "udpm://x"});
  stand.Hear("DRIVER_STATUS", Driver(driver_status_t::ARMED));
  stand.Call(kEmergencyStop);
  REQUIRE(stand.requests.size() == 1);
  CHECK(stand.requests[0].request == driver_request_t::ESTOP);
  stand.Pass(100'000);
  CHECK(stand.requests.size() == 2);  // again, until it is answered
  CHECK(stand.Answer() == "none yet");
  stand.Hear("DRIVER_STATUS",
             Driver(driver_status_t::FAULT, stand.requests[0].identity, "emergency stop"));
  CHECK(stand.Answer() == "yes: stopped; not armed: emergency stop");
  stand.Pass(100'000);
  CHECK(stand.requests.size() == 2);
}

TEST_CASE("arming is asked for once, by one who may") {
  Stand stand;
  stand.Call(kArm);
  CHECK(stand.requests.empty());  // there is no driver yet
  stand.Hear("DRIVER_STATUS", Driver(driver_status_t::IDLE));
  REQUIRE(stand.requests.size() == 1);
  CHECK(stand.requests[0].request == driver_request_t::ARM);
  stand.Pass(200'000);
  CHECK(stand.requests.size() == 1);
  stand.Hear("DRIVER_STATUS",
             Driver(driver_status_t::FAULT, stand.requests[0].identity, "pivot: hot"));
  CHECK(stand.Answer() == "no: not armed: pivot: hot");
  Looker other("without the token");
  stand.gateway.Join(other.viewer);
  stand.gateway.OnBinary(other.viewer, Looker::CallOf(kArm), stand.moment);
  other.Take();
  CHECK(other.answers.back() == json{{"ok", false}, {"text", "without the token"}});
  stand.gateway.OnBinary(other.viewer, Looker::CallOf(kEmergencyStop), stand.moment);
  CHECK(stand.requests.back().request == driver_request_t::ESTOP);
  stand.gateway.Leave(other.viewer);
  stand.Hear("DRIVER_STATUS", Driver(driver_status_t::IDLE, stand.requests.back().identity));
}

TEST_CASE("a driver that was once not believed, and then was, is not said to lack the key") {
  for (const bool believed_since : {false, true}) {
    Stand stand({{}, true, 100, "udpm://x"});
    stand.Hear("DRIVER_STATUS", Driver(driver_status_t::IDLE), false);
    if (believed_since) stand.Hear("DRIVER_STATUS", Driver(driver_status_t::IDLE));
    stand.Call(kEmergencyStop);
    for (int i = 0; i < 40; ++i) stand.Pass(100'000);
    INFO(stand.Answer());
    CHECK((stand.Answer().find("not signed") == std::string::npos) == believed_since);
  }
}

TEST_CASE("a person who places the robot is told what is missing") {
  Stand stand;
  stand.Call(kConfirmPlaced);
  CHECK(stand.Answer() == "no: no controller is heard");
  controller_status_t controller{};
  controller.utime = kUtime;
  controller.phase = controller_status_t::PLACING;
  stand.Hear("CONTROLLER_STATUS", controller);
  place_robot_t place{};
  place.num_positions = place.num_velocities = 1;
  place.q = {3.0};
  place.v = {0};
  stand.Hear("PLACE_ROBOT", place);
  stand.Hear("ROBOT_STATE", State(1, 0.5));
  stand.Call(kConfirmPlaced);
  CHECK(stand.Answer().starts_with("no: pivot is at 0.500, and is to be at 3.000"));
  stand.Hear("ROBOT_STATE", State(2, 3.0));
  stand.Call(kConfirmPlaced);
  CHECK(stand.Answer() == "yes: the robot is where it is to be");
}

TEST_CASE("what a client says wrongly is answered, and changes nothing") {
  Stand stand;
  for (const std::string& text :
       {std::string("{"), std::string("[]"), std::string(R"({"op":"publish"})"),
        std::string(R"({"op":"subscribe"})"),
        std::string(R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":4000}]})"),
        std::string(R"({"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]})"),
        std::string(R"({"op":"unsubscribe","subscriptionIds":[5]})"), std::string(2000, '[')}) {
    const size_t before = stand.looker.texts.size();
    stand.gateway.OnText(stand.looker.viewer, text);
    stand.looker.Take();
    INFO(text.substr(0, 80));
    REQUIRE(stand.looker.texts.size() == before + 1);
    CHECK(stand.looker.texts.back()["op"] == "status");
  }
  for (const std::vector<uint8_t>& frame :
       {std::vector<uint8_t>{}, std::vector<uint8_t>{1, 2, 3}, std::vector<uint8_t>{2, 1, 0, 0},
        Looker::CallOf(0), Looker::CallOf(99),
        std::vector<uint8_t>{2, 1, 0, 0, 0, 1, 0, 0, 0, 255, 255, 255, 255}}) {
    const size_t before = stand.looker.texts.size();
    stand.gateway.OnBinary(stand.looker.viewer, frame, stand.moment);
    stand.looker.Take();
    CHECK(stand.looker.texts.size() == before + 1);
  }
  CHECK(stand.requests.empty());
  CHECK(stand.looker.answers.empty());
}

TEST_CASE("one wrong wish of many is named, and the others are granted") {
  Stand stand;
  const auto topic = stand.looker.topics.at("ROBOT_STATE")["id"],
             other = stand.looker.topics.at("TRAINING_STATUS")["id"];
  const nlohmann::json wishes = {{{"id", 1}, {"channelId", 0}},
                                 {{"id", 2}, {"channelId", topic}},
                                 {{"id", 2}, {"channelId", other}},
                                 {{"id", 3}, {"channelId", other}}};
  const auto said = [&] {
    stand.looker.heard.clear();
    stand.Hear("ROBOT_STATE", State(1));
    stand.Hear("TRAINING_STATUS", Training(1, 1));
    stand.looker.Take();
    std::vector<uint32_t> subscriptions;
    for (const auto& heard : stand.looker.heard) subscriptions.push_back(heard.subscription);
    return subscriptions;
  };
  stand.gateway.OnText(stand.looker.viewer,
                       nlohmann::json{{"op", "subscribe"}, {"subscriptions", wishes}}.dump());
  stand.looker.Take();
  CHECK(stand.looker.texts.back()["op"] == "status");
  CHECK(said() == std::vector<uint32_t>{2, 3});
  stand.gateway.OnText(stand.looker.viewer, R"({"op":"unsubscribe","subscriptionIds":[9,2]})");
  stand.looker.Take();
  CHECK(stand.looker.texts.back()["op"] == "status");
  CHECK(said() == std::vector<uint32_t>{3});
}

TEST_CASE("a viewer has a topic once at a time: what is kept waits for him once") {
  Stand stand;
  for (int update = 0; update < 3; ++update) stand.Hear("TRAINING_STATUS", Training(1, update));
  const auto subscribe = [&](uint32_t id) {
    const auto topic = stand.looker.topics.at("TRAINING_STATUS")["id"];
    stand.gateway.OnText(
        stand.looker.viewer,
        json{{"op", "subscribe"}, {"subscriptions", {{{"id", id}, {"channelId", topic}}}}}.dump());
    stand.looker.Take();
  };
  for (uint32_t id = 1; id < 400; ++id) subscribe(id);
  CHECK(stand.looker.heard.size() == 3);
  CHECK_THAT(stand.looker.texts.back()["message"].get<std::string>(),
             Catch::EndsWith("is subscribed already"));
  stand.gateway.OnText(stand.looker.viewer, R"({"op":"unsubscribe","subscriptionIds":[1]})");
  subscribe(2);
  CHECK(stand.looker.heard.size() == 6);
}

}  // namespace
}  // namespace plumb
