#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "dashboard/foxglove.h"
#include "dashboard/history.h"
#include "dashboard/viewer.h"

namespace plumb {

/// What the gateway has to say, and who listens to what of it. Not thread-safe.
class Topics {
 public:
  static constexpr size_t kMaxTopics = 200;

  enum class Keep {
    kNewest,  ///< of what is fast: whoever comes late hears what `newest` gives
    kHistory
  };
  struct Message {
    int64_t utime;  ///< [us] of the run
    std::string json;
  };
  /// The newest message of a topic of which only that is kept, so that a page that is opened while
  /// time stands still shows something; none if there is none.
  std::function<std::optional<Message>(uint32_t topic)> newest = [](uint32_t) {
    return std::nullopt;
  };

  /// Offers it to everybody. @return its id, from 1 on.
  uint32_t Add(std::string name, std::string schema_name, std::string schema, Keep keep);
  /// Whether anybody would notice a message: it is listened to, or kept.
  bool wanted(uint32_t topic) const;
  bool watched(uint32_t topic) const { return !Of(topic).watchers.empty(); }

  /// @param utime [us] of the run. @param step, words as in History::Entry.
  void Publish(uint32_t topic, int64_t utime, std::string json,
               std::optional<History::Step> step = {}, size_t words = 0);

  /// The run has been set back to this time: what was said from then on is forgotten.
  void Rewind(int64_t utime);
  /// All viewers are told that the run's time is this.
  void SetTime(int64_t utime);

  void Join(Viewer& viewer);
  void Leave(Viewer& viewer);
  size_t viewers() const { return viewers_.size(); }
  int64_t dropped() const;  ///< for viewers that are there or have left

  /// What is kept comes first, in the order in which it was said. A viewer has a topic once, as
  /// Foxglove's protocol wants it: no more of what is kept waits for him than there is.
  /// @throws std::runtime_error, one line for the client, about the first that cannot be had; the
  /// others hold.
  void Subscribe(Viewer& viewer, std::span<const ClientMessage::Subscription> subscriptions);
  void Unsubscribe(Viewer& viewer, std::span<const uint32_t> subscriptions);

 private:
  struct Topic {
    Keep keep;
    History history;
    std::set<std::pair<Viewer*, uint32_t>> watchers;  // with their subscription
  };
  /// Why a viewer cannot have a topic under that subscription; empty if he can.
  std::string WhyNot(const Viewer& viewer, uint32_t subscription, uint32_t topic) const;
  Topic& Of(uint32_t topic) { return topics_[topic - 1]; }
  const Topic& Of(uint32_t topic) const { return topics_[topic - 1]; }

  std::vector<Topic> topics_;
  std::vector<FoxgloveTopic> described_;
  std::set<Viewer*> viewers_;
  uint64_t said_ = 0;    // messages that were kept so far
  int64_t dropped_ = 0;  // for viewers that have left
};

}  // namespace plumb
