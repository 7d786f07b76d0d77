#include "dashboard/gateway.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <regex>
#include <sstream>

#include "common/identity.h"
#include "dashboard/channels.h"
#include "plumb/driver_status_t.hpp"
#include "plumb/estimator_status_t.hpp"
#include "plumb/training_status_t.hpp"
#include "tests/dashboard/looker.h"

namespace plumb {
namespace {

using nlohmann::json;
using Bytes = std::vector<uint8_t>;

constexpr int64_t kUtime = 1'700'000'000'000'000;  // [us]

std::string Source() {
  const char* const source = std::getenv("PLUMBLINE_SOURCE");
  return source ? source : ".";
}

const RobotDescription& Pendulum() {
  static const RobotDescription robot = LoadRobot(Source() + "/robots/pendulum");
  return robot;
}

template <class Message>
Bytes Encode(const Message& message) {
  Bytes bytes(static_cast<size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

/// A gateway, what it asks the driver for, and its time.
struct Stand {
  explicit Stand(Gateway::Setting setting = {})
      : gateway(Pendulum(), setting,
                [this](const driver_request_t& request) { requests.push_back(request); }) {
    gateway.Join(looker.viewer);
    looker.Take();
  }
  template <class Message>
  void Hear(const std::string& channel, const Message& message, bool believed = true) {
    gateway.OnMessage(channel, Encode(message), believed, moment.now, moment);
  }
  void Listen(const std::string& topic) {
    gateway.OnText(looker.viewer, looker.Subscription(topic));
  }
  void Call(uint8_t service) { gateway.OnBinary(looker.viewer, Looker::CallOf(service), moment); }
  void Pass(int64_t us) {
    moment.now += us, moment.utime += us, moment.date += us;
    gateway.Tick(moment);
  }
  /// ok and text of the newest answer.
  std::string Answer() {
    looker.Take();
    if (looker.answers.empty()) return "none yet";
    const json& answer = looker.answers.back();
    return (answer["ok"] == true ? "yes: " : "no: ") + answer["text"].get<std::string>();
  }

  std::vector<driver_request_t> requests;
  Gateway gateway;
  Looker looker;
  Gateway::Moment moment{1'000'000, kUtime, kUtime};
};

robot_state_t State(int64_t sequence, double q = 0.1) {
  robot_state_t state{};
  state.utime = kUtime + 5000 * sequence;
  state.sequence = sequence;
  state.num_joints = 1;
  state.q = {q};
  state.v = {0};
  state.q_sd = state.v_sd = {0.001};
  state.effort = {0};
  state.valid = true;
  return state;
}

training_status_t Training(int iteration, int update) {
  training_status_t status{};
  status.utime = kUtime + update;
  status.iteration = iteration;
  status.update = update;
  return status;
}

driver_status_t Driver(int8_t state, int64_t answered = 0, const std::string& reason = "") {
  driver_status_t status{};
  status.utime = kUtime;
  status.state = state;
  status.answered = answered;
  status.reason = reason;
  return status;
}

enum : uint8_t { kEmergencyStop = 1, kArm, kDisarm, kConfirmPlaced };

TEST_CASE("the page is offered every channel of docs/messages.md, with its type") {
  std::ifstream file(Source() + "/docs/messages.md");
  std::ostringstream text;
  text << file.rdbuf();
  const std::string page = text.str();
  std::map<std::string, std::string> documented, offered;
  const std::regex row(R"(\n\| `(\w+)`(?: and `(\w+)`)? \|[^\n]*\| \[(\w+)\])");
  for (std::sregex_iterator found(page.begin(), page.end(), row), end; found != end; ++found) {
    documented[(*found)[1]] = (*found)[3];
    if ((*found)[2].matched) documented[(*found)[2]] = (*found)[3];
  }
  for (const ChannelOfPage& channel : ChannelsOfPage())
    offered[std::string(channel.name)] = channel.type;
  CHECK(offered == documented);
  Stand stand;
  for (const auto& [name, type] : offered) {
    REQUIRE(stand.looker.topics.contains(name));
    CHECK(stand.looker.topics[name]["schemaName"] == "plumb." + type);
    CHECK(stand.looker.topics[name]["encoding"] == "json");
  }
}

TEST_CASE("whoever has asked for a channel hears each of its messages, and nobody else's") {
  Stand stand;
  stand.Listen("ROBOT_STATE");
  for (int i = 0; i < 500; ++i) stand.Hear("ROBOT_STATE", State(i, 0.001 * i));
  stand.Hear("TRAINING_STATUS", Training(1, 1));
  stand.looker.Take();
  REQUIRE(stand.looker.heard.size() == 500);
  CHECK(stand.looker.heard[123].json["sequence"] == 123);
  CHECK(stand.looker.heard[123].json["q"] == json{0.123});
  CHECK(stand.looker.heard[123].utime == State(123).utime);
  stand.gateway.OnText(stand.looker.viewer, R"({"op":"unsubscribe","subscriptionIds":[)" +
                                                stand.looker.topics["ROBOT_STATE"]["id"].dump() +
                                                "]}");
  stand.Hear("ROBOT_STATE", State(500));
  stand.looker.Take();
  CHECK(stand.looker.heard.size() == 500);
}

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

TEST_CASE("the table of channels counts every message, and what does not decode") {
  Stand stand;
  stand.Pass(500'000);
  stand.Listen("PLUMB_CHANNELS");
  for (int i = 0; i < 1000; ++i) {
    stand.moment.now += 2000;
    stand.Hear("ROBOT_STATE", State(i));
  }
  Bytes cut = Encode(State(0));
  cut.pop_back();
  stand.gateway.OnMessage("ROBOT_STATE", cut, true, stand.moment.now, stand.moment);
  stand.Hear("JOINT_STATE", State(0));                                        // of another type
  stand.gateway.OnMessage("STRANGE", Bytes{1, 2, 3}, true, 0, stand.moment);  // of none
  stand.Hear("POLICY", State(0), false);                                      // not to be believed
  stand.Pass(0);
  stand.looker.Take();
  const json channels = stand.looker.heard.back().json["channels"];
  const auto row = [&](const std::string& name) {
    for (const json& channel : channels) {
      if (channel["channel"] == name) return channel;
    }
    return json();
  };
  CHECK(row("ROBOT_STATE")["count"] == 1001);
  CHECK(row("ROBOT_STATE")["undecodable"] == 1);
  CHECK(row("ROBOT_STATE")["type"] == "robot_state_t");
  CHECK(row("ROBOT_STATE")["rate"].get<double>() == Approx(500).epsilon(0.01));
  CHECK(row("ROBOT_STATE")["jitter_ms"].get<double>() < 0.1);
  CHECK(row("JOINT_STATE")["undecodable"] == 1);
  CHECK(row("STRANGE")["undecodable"] == 1);
  CHECK(row("POLICY")["refused"] == 1);
}

TEST_CASE("a channel that no document knows is offered when it is heard") {
  Stand stand;
  stand.Hear("TRUE_STATE", State(1));
  stand.looker.Take();
  REQUIRE(stand.looker.topics.contains("TRUE_STATE"));
  stand.Listen("TRUE_STATE");
  stand.Hear("TRUE_STATE", State(2));
  stand.looker.Take();
  REQUIRE(stand.looker.heard.size() == 2);  // what was there, and what came
  CHECK(stand.looker.heard[0].json["sequence"] == 1);
  CHECK(stand.looker.heard[1].json["sequence"] == 2);
}

TEST_CASE("times that are none, and names that are ours, do no harm") {
  Stand stand;
  for (const char* topic : {"PLUMB_SCENE", "PLUMB_PREDICTION", "PLUMB_GATEWAY"})
    stand.Listen(topic);
  const int64_t last = std::numeric_limits<int64_t>::max();
  for (const int64_t utime : {last, -last - 1, kUtime, last, int64_t{0}}) {
    robot_state_t state = State(1);
    state.utime = utime;
    state.sequence = utime;
    stand.Pass(1'000'000);
    stand.Hear("ROBOT_STATE", state);
    driver_status_t status = Driver(driver_status_t::ARMED);
    status.utime = utime;
    stand.Call(kEmergencyStop);
    stand.Hear("DRIVER_STATUS", status);
    stand.Pass(100'000);
  }
  stand.looker.Take();
  CHECK(std::ranges::count_if(stand.looker.heard, [](const Looker::Heard& heard) {
          return heard.json.contains("speed") && heard.json["speed"].is_number();
        }) == 5);
  const size_t topics = stand.looker.topics.size();
  stand.Hear("PLUMB_SCENE", State(1));
  stand.looker.Take();
  CHECK(stand.looker.topics.size() == topics);
}

TEST_CASE("what follows from messages: a picture, a prediction, a posterior beside its prior") {
  Stand stand;
  for (const char* topic : {"PLUMB_SCENE", "PLUMB_PREDICTION", "PLUMB_POSTERIOR"})
    stand.Listen(topic);
  parameter_distribution_t prior = ParameterDistribution::Prior(Pendulum()).ToMessage();
  prior.iteration = 1;
  stand.Hear("PARAMETER_DISTRIBUTION", prior);
  stand.Hear("PARAMETER_DISTRIBUTION", prior);  // repeated
  for (int i = 0; i < 30; ++i) {
    stand.moment.now += 5000;
    stand.Hear("ROBOT_STATE", State(i));
  }
  stand.looker.Take();
  std::map<uint32_t, std::vector<json>> by_topic;
  for (const auto& heard : stand.looker.heard) by_topic[heard.subscription].push_back(heard.json);
  const auto of = [&](const char* topic) { return by_topic[stand.looker.topics[topic]["id"]]; };
  REQUIRE(of("PLUMB_POSTERIOR").size() == 1);
  const json posterior = of("PLUMB_POSTERIOR")[0];
  CHECK(posterior["parameters"][0]["mean"].get<double>() == Approx(10.4));
  CHECK(posterior["parameters"][0]["determined"] == false);
  CHECK(posterior["samples"].size() == 200);
  CHECK(posterior["samples"] == posterior["prior_samples"]);
  // 150 ms of states: a picture every 33 ms, a prediction every 20, once 40 ms of them are there
  CHECK(of("PLUMB_SCENE").size() == 5);
  CHECK(of("PLUMB_PREDICTION").size() == 6);
  const json prediction = of("PLUMB_PREDICTION").back();
  CHECK(prediction["q_measured"] == json{0.1});
  CHECK(of("PLUMB_SCENE").back()["entities"][1]["id"] == "robot");
  CHECK(of("PLUMB_SCENE").back()["entities"][2]["id"] == "prediction");
}

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
  CHECK(stand.Answer() == "yes: not armed: emergency stop");
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

TEST_CASE(
    "in virtual time nothing is asked for but a stop, as whoever starts the run says, or its "
    "seals") {
  const bool told = GENERATE(true, false);
  Gateway::Setting setting;
  if (told) setting.kind = RunTime::Kind::kVirtual;
  Stand stand(setting);
  Identity sender("plumb-driver", {}, Clock(std::make_shared<VirtualTime>()), Identity::Reach::kRun,
                  0);
  Bytes message = Encode(Driver(driver_status_t::IDLE));
  message.resize(message.size() + kSealSize);
  sender.Seal("DRIVER_STATUS", message);
  if (!told) CHECK(stand.gateway.WhyNotArm().empty());
  stand.gateway.OnMessage("DRIVER_STATUS", message, true, 0, stand.moment);
  CHECK_FALSE(stand.gateway.WhyNotArm().empty());
  for (const uint8_t service : {kArm, kDisarm, kConfirmPlaced}) {
    stand.Call(service);
    CHECK(stand.Answer() == "no: a run in virtual time hears nobody from outside");
  }
  CHECK(stand.requests.empty());
  stand.Call(kEmergencyStop);
  CHECK(stand.requests.size() == 1);
}

TEST_CASE("how many times faster than real time a run goes is said once a second") {
  Stand stand;
  stand.Listen("PLUMB_GATEWAY");
  for (int i = 0; i < 300; ++i) {
    stand.Pass(10'000);
    stand.Hear("ROBOT_STATE", State(4 * i));  // 20 ms of the run
  }
  stand.looker.Take();
  CHECK(stand.looker.heard.size() >= 3);
  CHECK(stand.looker.heard.back().json["speed"].get<double>() == Approx(2).epsilon(0.05));
  CHECK(stand.looker.heard.back().json["clients"] == 1);
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
  place.num_joints = 1;
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

TEST_CASE("who does not read misses the oldest states, none of the rest, and holds up nobody") {
  Stand stand;
  Looker other;
  stand.gateway.Join(other.viewer);
  other.Take();
  stand.Listen("ROBOT_STATE");
  stand.Listen("DRIVER_STATUS");
  stand.gateway.OnText(other.viewer, other.Subscription("ROBOT_STATE"));
  stand.Hear("DRIVER_STATUS", Driver(driver_status_t::IDLE));
  const int messages = 40'000;
  for (int i = 0; i < messages; ++i) {
    stand.Hear("ROBOT_STATE", State(i));
    other.Take();
  }
  CHECK(other.heard.size() == messages);
  CHECK(other.viewer.outbox.dropped() == 0);
  const int64_t dropped = stand.looker.viewer.outbox.dropped();
  CHECK(dropped > 0);
  stand.looker.Take();
  CHECK(stand.looker.heard.size() == static_cast<size_t>(messages + 1 - dropped));
  CHECK(stand.looker.heard[0].json.contains("bus_up"));  // the driver's status is still there
  CHECK(stand.looker.heard.back().json["sequence"] == messages - 1);
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
  for (const Bytes& frame :
       {Bytes{}, Bytes{1, 2, 3}, Bytes{2, 1, 0, 0}, Looker::CallOf(0), Looker::CallOf(99),
        Bytes{2, 1, 0, 0, 0, 1, 0, 0, 0, 255, 255, 255, 255}}) {
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
  const auto topic = stand.looker.topics.at("ROBOT_STATE")["id"];
  const nlohmann::json wishes = {{{"id", 1}, {"channelId", 0}},
                                 {{"id", 2}, {"channelId", topic}},
                                 {{"id", 2}, {"channelId", topic}},
                                 {{"id", 3}, {"channelId", topic}}};
  const auto said = [&] {
    stand.looker.heard.clear();
    stand.Hear("ROBOT_STATE", State(1));
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

}  // namespace
}  // namespace plumb
