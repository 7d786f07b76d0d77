#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dashboard/gateway.h"

namespace plumb {

/// Somebody at the page, without a socket: takes what waits for him.
struct Looker {
  explicit Looker(std::string why_not_arm = "") : viewer(std::move(why_not_arm), [] {}) {}

  struct Heard {
    uint32_t subscription;
    int64_t utime;
    nlohmann::json json;
  };
  /// Texts of the protocol, messages of topics, answers of services, in order of arrival.
  void Take() {
    while (const auto item = viewer.outbox.Pop()) {
      if (!item->binary) {
        texts.push_back(nlohmann::json::parse(*item->payload));
        for (const auto& topic : texts.back().value("channels", nlohmann::json::array()))
          topics[topic["topic"]] = topic;
      } else if (item->tells_time()) {
        times.push_back(*item->utime);
      } else if (!item->is_message()) {
        answers.push_back(nlohmann::json::parse(item->payload->substr(17)));
      } else {
        heard.push_back({item->subscription, *item->utime, nlohmann::json::parse(*item->payload)});
      }
    }
  }
  /// The subscription's number is the topic's.
  std::string Subscription(const std::string& topic) {
    const auto id = topics.at(topic)["id"];
    return nlohmann::json{{"op", "subscribe"}, {"subscriptions", {{{"id", id}, {"channelId", id}}}}}
        .dump();
  }
  static std::vector<uint8_t> CallOf(uint8_t service, uint8_t number = 7) {
    return {2, service, 0, 0, 0, number, 0, 0, 0, 4, 0, 0, 0, 'j', 's', 'o', 'n', '{', '}'};
  }

  Viewer viewer;
  std::vector<nlohmann::json> texts, answers;
  std::map<std::string, nlohmann::json> topics;
  std::vector<Heard> heard;
  std::vector<int64_t> times;  // [us] that were told
};

}  // namespace plumb
