#include "common/lockstep/participant.h"

#include <algorithm>
#include <utility>

namespace plumb {

void Participant::Hear(lockstep_post_t&& post) {
  auto& queue = post.topic.kind == lockstep_topic_t::FRAME ? frames_[post.topic.name] : messages_;
  queue.push_back(std::move(post));
}

bool Participant::heard() const {
  return !messages_.empty() ||
         std::ranges::any_of(frames_, [](const auto& bus) { return !bus.second.empty(); });
}

lockstep_topic_t ChannelTopic(const std::string& channel) {
  lockstep_topic_t topic;
  topic.kind = lockstep_topic_t::MESSAGE;
  topic.name = channel;
  return topic;
}

lockstep_topic_t BusTopic(const std::string& url) {
  lockstep_topic_t topic;
  topic.kind = lockstep_topic_t::FRAME;
  topic.name = url;
  return topic;
}

}  // namespace plumb
