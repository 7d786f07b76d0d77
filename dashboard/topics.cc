#include "dashboard/topics.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace plumb {

uint32_t Topics::Add(std::string name, std::string schema_name, std::string schema, Keep keep) {
  const auto id = static_cast<uint32_t>(topics_.size()) + 1;
  topics_.push_back({keep, {}, {}});
  described_.push_back({id, std::move(name), std::move(schema_name), std::move(schema)});
  for (Viewer* viewer : viewers_) viewer->Say(AdvertiseText(std::span(&described_.back(), 1)));
  return id;
}

bool Topics::wanted(uint32_t topic) const {
  return Of(topic).keep == Keep::kHistory || watched(topic);
}

void Topics::Publish(uint32_t id, int64_t utime, std::string json,
                     std::optional<History::Step> step, size_t words) {
  Topic& topic = Of(id);
  const auto payload = std::make_shared<const std::string>(std::move(json));
  const auto kind = topic.keep == Keep::kHistory ? Outbox::Kind::kSlow : Outbox::Kind::kFast;
  for (const auto& [viewer, subscription] : topic.watchers) {
    viewer->outbox.Push({kind, true, subscription, utime, payload});
    viewer->wake();
  }
  if (topic.keep == Keep::kHistory) topic.history.Add({++said_, utime, step, words, payload});
}

void Topics::Rewind(int64_t utime) {
  for (Topic& topic : topics_) topic.history.Rewind(utime);
  SetTime(utime);
}

void Topics::SetTime(int64_t utime) {
  for (Viewer* viewer : viewers_) viewer->SetTime(utime);
}

void Topics::Join(Viewer& viewer) {
  viewers_.insert(&viewer);
  viewer.Say(AdvertiseText(described_));
}

void Topics::Leave(Viewer& viewer) {
  for (const auto& [subscription, topic] : viewer.subscriptions)
    Of(topic).watchers.erase({&viewer, subscription});
  if (viewers_.erase(&viewer) > 0) dropped_ += viewer.outbox.dropped();
}

int64_t Topics::dropped() const {
  int64_t dropped = dropped_;
  for (const Viewer* viewer : viewers_) dropped += viewer->outbox.dropped();
  return dropped;
}

std::string Topics::WhyNot(const Viewer& viewer, uint32_t id, uint32_t topic) const {
  if (topic == 0 || topic > topics_.size())
    return fmt::format("channelId: there is no channel {}", topic);
  if (viewer.subscriptions.contains(id))
    return fmt::format("id: there is a subscription {} already", id);
  const auto topic_of = [](const auto& subscription) { return subscription.second; };
  if (std::ranges::find(viewer.subscriptions, topic, topic_of) != viewer.subscriptions.end())
    return fmt::format("channelId: {} is subscribed already", topic);
  return "";
}

void Topics::Subscribe(Viewer& viewer, std::span<const ClientMessage::Subscription> wishes) {
  std::vector<std::pair<const History::Entry*, uint32_t>> kept;  // with their subscription
  std::string first_wrong;  // what cannot be had is no reason to withhold the rest
  for (const auto& [id, topic] : wishes) {
    if (const std::string wrong = WhyNot(viewer, id, topic); !wrong.empty()) {
      if (first_wrong.empty()) first_wrong = wrong;
      continue;
    }
    viewer.subscriptions[id] = topic;
    Of(topic).watchers.insert({&viewer, id});
    for (const History::Entry& entry : Of(topic).history.entries()) kept.push_back({&entry, id});
    if (Of(topic).keep != Keep::kNewest) continue;
    if (auto message = newest(topic)) {
      viewer.outbox.Push({Outbox::Kind::kFast, true, id, message->utime,
                          std::make_shared<const std::string>(std::move(message->json))});
    }
  }
  std::ranges::sort(kept, {}, [](const auto& one) { return one.first->order; });
  for (const auto& [entry, id] : kept) {
    viewer.outbox.Push({Outbox::Kind::kHistory, true, id, entry->utime, entry->json});
  }
  viewer.wake();
  if (!first_wrong.empty()) throw std::runtime_error(first_wrong);
}

void Topics::Unsubscribe(Viewer& viewer, std::span<const uint32_t> subscriptions) {
  std::string first_wrong;
  for (const uint32_t id : subscriptions) {
    const auto found = viewer.subscriptions.find(id);
    if (found == viewer.subscriptions.end()) {
      if (first_wrong.empty())
        first_wrong = fmt::format("subscriptionIds: there is no subscription {}", id);
      continue;
    }
    Of(found->second).watchers.erase({&viewer, id});
    viewer.subscriptions.erase(found);
    viewer.outbox.Forget(id);
  }
  if (!first_wrong.empty()) throw std::runtime_error(first_wrong);
}

}  // namespace plumb
