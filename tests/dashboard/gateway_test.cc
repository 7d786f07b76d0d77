#include "dashboard/gateway.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <limits>
#include <regex>
#include <sstream>

#include "common/identity.h"
#include "dashboard/channels.h"
#include "tests/dashboard/gateway_stand.h"

namespace plumb {
namespace {

using nlohmann::json;

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

TEST_CASE("however many channels somebody invents, the robot's own are told of") {
  Stand stand;
  stand.Listen("PLUMB_CHANNELS");
  for (int i = 0; i < 300; ++i)
    stand.gateway.OnMessage("X" + std::to_string(i), std::vector<uint8_t>{1, 2, 3}, true, 0,
                            stand.moment);
  stand.Hear("ROBOT_STATE", State(0));
  stand.Pass(500'000);
  stand.looker.Take();
  const json channels = stand.looker.heard.back().json["channels"];
  CHECK(channels.size() == ChannelStatistics::kMaxChannels + 1);
  CHECK(std::ranges::any_of(
      channels, [](const json& channel) { return channel["channel"] == "ROBOT_STATE"; }));
}

TEST_CASE("the table of channels counts every message, and what does not decode") {
  Stand stand;
  stand.Pass(500'000);
  stand.Listen("PLUMB_CHANNELS");
  for (int i = 0; i < 1000; ++i) {
    stand.moment.now += 2000;
    stand.Hear("ROBOT_STATE", State(i));
  }
  std::vector<uint8_t> cut = Encode(State(0));
  cut.pop_back();
  stand.gateway.OnMessage("ROBOT_STATE", cut, true, stand.moment.now, stand.moment);
  stand.Hear("JOINT_STATE", State(0));  // of another type
  stand.gateway.OnMessage("STRANGE", std::vector<uint8_t>{1, 2, 3}, true, 0,
                          stand.moment);  // of none
  stand.Hear("POLICY", State(0), false);  // not to be believed
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
  // 2 ms each: in the bin of 1024 to 2047 us, but for the last, at the same moment.
  const json intervals = row("ROBOT_STATE")["intervals"];
  CHECK(intervals.size() == 24);
  CHECK(intervals[10] == 999);
  CHECK(intervals[0] == 1);
  CHECK(row("POLICY")["intervals"] == json(std::vector<int>(24)));
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
  for (const char* topic : {"PLUMB_SCENE", "PLUMB_FRAME", "PLUMB_PREDICTION", "PLUMB_GATEWAY"})
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
  // After the time that such a state says that it is, none would be told any more.
  CHECK(*std::ranges::max_element(stand.looker.times) <= stand.moment.utime);
  const size_t topics = stand.looker.topics.size();
  stand.Hear("PLUMB_SCENE", State(1));
  stand.looker.Take();
  CHECK(stand.looker.topics.size() == topics);
}

/// Whether a schema has lists of lists anywhere.
bool ListsLists(const json& schema, bool in_list = false) {
  const bool list = schema.value("type", json()) == "array";
  if (list && in_list) return true;
  if (list) return ListsLists(schema["items"], true);
  return std::ranges::any_of(schema.value("properties", json::object()),
                             [](const json& property) { return ListsLists(property); });
}

TEST_CASE("no schema has lists of lists, which Foxglove and Lichtblick refuse with their topic") {
  Stand stand;
  stand.looker.Take();
  REQUIRE(stand.looker.topics.size() > 15);
  for (const auto& [name, topic] : stand.looker.topics) {
    INFO(name);
    CHECK_FALSE(ListsLists(json::parse(topic["schema"].get<std::string>())));
  }
  CHECK(ListsLists(json::parse(
      R"({"type":"object","properties":{"a":{"type":"array","items":{"type":"array"}}}})")));
}

TEST_CASE("the run's time is told before what was said then, and again where it goes back") {
  Stand stand;
  stand.Listen("ROBOT_STATE");
  for (int i = 0; i < 30; ++i) {
    stand.moment.now += 2000;
    robot_state_t state = State(i);
    state.utime = kUtime + 2000 * i;
    stand.Hear("ROBOT_STATE", state);
  }
  stand.looker.Take();
  const size_t before = stand.looker.times.size();
  CHECK(before == 10);  // every 6 ms: of each third
  CHECK(std::ranges::is_sorted(stand.looker.times));
  robot_state_t state = State(0);
  state.utime = kUtime - 1'000'000;
  stand.Hear("ROBOT_STATE", state);
  stand.looker.Take();
  REQUIRE(stand.looker.times.size() == before + 1);
  CHECK(stand.looker.times.back() == state.utime);
  Stand early;  // before there is a run there is the machine's time
  early.Listen("PLUMB_GATEWAY");
  early.Pass(1'000'000);
  early.looker.Take();
  CHECK(early.looker.times == std::vector<int64_t>{kUtime + 1'000'000});
  early.Hear("ROBOT_STATE", State(0));
  early.looker.Take();
  CHECK(early.looker.times.back() == kUtime);
  Looker late;
  stand.gateway.Join(late.viewer);
  late.Take();
  CHECK(late.times == std::vector<int64_t>{state.utime});
  stand.gateway.Leave(late.viewer);
}

TEST_CASE("what follows from messages: a picture, a prediction, a posterior beside its prior") {
  Stand stand;
  for (const char* topic : {"PLUMB_SCENE", "PLUMB_FRAME", "PLUMB_PREDICTION", "PLUMB_POSTERIOR"})
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
  CHECK(of("PLUMB_FRAME").size() == 5);
  CHECK(of("PLUMB_FRAME").back()["child_frame_id"] == "robot");
  CHECK(of("PLUMB_PREDICTION").size() == 6);
  const json prediction = of("PLUMB_PREDICTION").back();
  CHECK(prediction["q_measured"] == json{0.1});
  CHECK(of("PLUMB_SCENE").back()["entities"][1]["id"] == "robot");
  CHECK(of("PLUMB_SCENE").back()["entities"][2]["id"] == "prediction");
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
  std::vector<uint8_t> message = Encode(Driver(driver_status_t::IDLE));
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
  CHECK(stand.looker.heard[0].json.contains("num_buses"));  // the driver's status is still there
  CHECK(stand.looker.heard.back().json["sequence"] == messages - 1);
}

}  // namespace
}  // namespace plumb
