#include "records/pacing.h"

#include <algorithm>

namespace plumb {
namespace {

// Half of Linux's net.core.rmem_default: a quarter of a buffer may be taken by what has been read.
constexpr size_t kRoom = 106'496;
// Less than the 30 messages that liblcm 1.3.1 keeps for a subscription.
constexpr int kBurst = 25;

/// What a message takes of a listener's buffer, at most.
size_t Cost(size_t size) { return 2 * size + 1024; }

}  // namespace

bool Pacing::MaySend(size_t size) {
  const size_t cost = Cost(size);
  if (waiting_ + sent_ + cost > kRoom || burst_ >= kBurst) {
    LookAgain();
    // One that is larger than the room goes alone.
    if (waiting_ > 0 && waiting_ + cost > kRoom) return false;
    if (burst_ >= kBurst && working_ && ++work_naps_ < kWorkPatience) return false;
    if (burst_ >= kBurst) burst_ = work_naps_ = 0;
  }
  sent_ += cost;
  ++burst_;
  return true;
}

void Pacing::LookAgain() {
  std::map<uint64_t, State> now;
  waiting_ = 0;
  working_ = false;
  for (const auto& [queue, working] : look_()) {
    const auto known = listeners_.find(queue.socket);
    State listener = known == listeners_.end() ? State{queue.drops} : known->second;
    lost_ += queue.drops - std::min(queue.drops, listener.drops);
    listener.drops = queue.drops;
    if (queue.waiting == 0 || queue.waiting < listener.waiting) {
      listener.naps = 0;
    } else if (sent_ == 0) {  // else it may have taken as much as there came
      ++listener.naps;
    }
    listener.waiting = queue.waiting;
    if (listener.naps < kPatience) {
      waiting_ = std::max(waiting_, queue.waiting);
      working_ = working_ || working;
    }
    now.emplace(queue.socket, listener);
  }
  listeners_ = std::move(now);
  sent_ = 0;
}

uint64_t Pacing::Lost() {
  LookAgain();
  return lost_;
}

int Pacing::standing_still() const {
  return static_cast<int>(std::ranges::count_if(
      listeners_, [](const auto& entry) { return entry.second.naps >= kPatience; }));
}

}  // namespace plumb
