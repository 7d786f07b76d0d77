#include "chaos/chronicle.h"

#include <fmt/format.h>

#include "common/lockstep/coordinator.h"
#include "common/time_units.h"

namespace plumb {
namespace {

template <class Item>
void Keep(std::deque<Item>& items, Item item, size_t most) {
  items.push_back(std::move(item));
  if (items.size() > most) items.pop_front();
}

std::string At(int64_t time) {
  return fmt::format("{:.6f} s: ", Seconds(time - Coordinator::kBeginning));
}

}  // namespace

void Chronicle::AddPrank(const std::string& text) { Keep(pranks_, text, kPranksTold); }

void Chronicle::AddTurn(int64_t time, const std::string& text) {
  if (!violated()) Keep(turns_, At(time) + text, kTurnsTold);
}

void Chronicle::AddPost(int64_t time, const lockstep_post_t& post, const std::string& speaker) {
  fingerprint_ = Hash(&time, sizeof time, fingerprint_);
  fingerprint_ = Hash(speaker, Hash(post.topic.name, fingerprint_));
  fingerprint_ = Hash(post.data.data(), post.data.size(), fingerprint_);
  const bool frame = post.topic.kind == lockstep_topic_t::FRAME;
  ++(frame ? frames_ : messages_);
  if (violated()) return;
  Keep(posts_,
       {time, speaker, post.topic,
        frame ? std::string(post.data.begin(), post.data.end()) : std::string(), post.data.size()},
       kPostsTold);
}

void Chronicle::Violate(int invariant, int64_t time, const std::string& text) {
  if (violated()) return;
  invariant_ = invariant;
  violation_ = fmt::format("invariant {}: {}{}", invariant, At(time), text);
}

std::string Chronicle::Story() const {
  if (!violated()) return "";
  std::string story = *violation_ + "\n  the monkey did last:\n";
  for (const std::string& line : pranks_) story += "    " + line + "\n";
  story += "  of note:\n";
  for (const std::string& line : turns_) story += "    " + line + "\n";
  story += "  said last:\n";
  for (const Said& said : posts_) {
    story += fmt::format(
        "    {}{} {}\n", At(said.time), said.speaker.empty() ? "the monkey" : said.speaker,
        said.data.empty() ? fmt::format("{}, {} bytes", said.topic.name, said.size) : said.data);
  }
  return story;
}

}  // namespace plumb
