#include "chaos/wire.h"

#include <algorithm>

#include "drivers/can/frame.h"

namespace plumb {
namespace {

constexpr uint32_t kWireStream = 0x57697265;  // "Wire"

bool IsFrame(const lockstep_post_t& post) { return post.topic.kind == lockstep_topic_t::FRAME; }

void FlipBit(lockstep_post_t& post, Random& random) {
  if (!IsFrame(post)) {
    if (!post.data.empty())
      post.data[random.Below(post.data.size())] ^= static_cast<uint8_t>(1u << random.Below(8));
    return;
  }
  auto frame = FrameFromText({reinterpret_cast<const char*>(post.data.data()), post.data.size()});
  if (!frame || frame->length == 0) return;
  frame->data[random.Below(frame->length)] ^= static_cast<uint8_t>(1u << random.Below(8));
  const std::string text = ToText(*frame);
  post.data.assign(text.begin(), text.end());
  post.size = static_cast<int32_t>(post.data.size());
}

}  // namespace

void Wire::Begin(const Prank& prank, int64_t now) {
  windows_.push_back({prank, now + prank.duration, Random(seed_, {kWireStream, prank.number})});
}

std::vector<lockstep_post_t> Wire::Carry(const lockstep_post_t& post, const std::string& listener,
                                         int64_t now) {
  std::erase_if(windows_, [&](const Window& window) { return window.end <= now; });
  std::vector<lockstep_post_t> arrivals{post};
  for (Window& window : windows_) {
    const bool whom = window.prank.whom.empty() || window.prank.whom == listener;
    const bool what = window.prank.topic == (IsFrame(post) ? kBus : post.topic.name);
    if (whom && what) Befall(window, arrivals);
  }
  return arrivals;
}

void Wire::Befall(Window& window, std::vector<lockstep_post_t>& arrivals) const {
  Random& random = window.random;
  const Prank& prank = window.prank;
  const bool always = prank.what == Mischief::kBusDown || prank.what == Mischief::kDelay;
  if (!always && random.Uniform() >= prank.amount) return;
  switch (prank.what) {
    case Mischief::kDrop:
    case Mischief::kBusDown:
      arrivals.clear();
      return;
    case Mischief::kDelay:
      for (lockstep_post_t& arrival : arrivals)
        arrival.arrival += static_cast<int64_t>(random.Uniform() * prank.amount);
      return;
    case Mischief::kDouble:
      if (arrivals.empty()) return;
      arrivals.push_back(arrivals.back());
      arrivals.back().arrival += static_cast<int64_t>(random.Uniform() * 5e4);
      return;
    case Mischief::kCorrupt:
      for (lockstep_post_t& arrival : arrivals) FlipBit(arrival, random);
      return;
    case Mischief::kMadden:
      for (lockstep_post_t& arrival : arrivals) madness_(arrival, random);
      return;
    default:
      return;
  }
}

}  // namespace plumb
