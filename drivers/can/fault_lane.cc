#include "drivers/can/fault_lane.h"

#include <algorithm>

#include "drivers/can/transport.h"

namespace plumb {

FaultLane::FaultLane(const Faults::Side& side, uint64_t seed, uint32_t stream)
    : side_(side), random_(seed, {stream}), ring_(kCapacity) {}

void FaultLane::Add(const Frame& frame, int64_t now) noexcept {
  // As many draws for every frame: what happens to the next must not depend on what happens to this
  // one.
  const bool lost = random_.Uniform() < side_.loss;
  const bool doubled = random_.Uniform() < side_.duplicate;
  const bool held = random_.Uniform() < side_.reorder;
  const bool corrupt = random_.Uniform() < side_.corrupt;
  const double late = random_.Uniform();
  const uint32_t bits = random_.Bits();
  if (lost) {
    ++injected_;
    return;
  }
  Frame changed = frame;
  if (corrupt && !frame.payload().empty()) {
    const uint32_t bit = bits % static_cast<uint32_t>(8 * frame.payload().size());
    changed.data[bit / 8] ^= static_cast<uint8_t>(1u << bit % 8);
    ++injected_;
  }
  if (doubled) ++injected_;
  if (held && copies_ == 0) {
    held_ = changed;
    copies_ = doubled ? 2 : 1;
    ++injected_;
    return;
  }
  const int64_t due =
      now + side_.delay + static_cast<int64_t>(late * static_cast<double>(side_.jitter));
  Append(changed, due);
  if (doubled) Append(changed, due);
  for (; copies_ > 0; --copies_) Append(held_, due);
}

void FaultLane::Append(const Frame& frame, int64_t due) noexcept {
  if (size_ == kCapacity) return;
  last_due_ = std::max(last_due_, due);
  Entry& entry = ring_[(first_ + size_) % kCapacity];
  entry = {frame, last_due_};
  // Its stamp would be of another time.
  if (side_.delay > 0 || side_.jitter > 0) entry.frame.receive_ns = 0;
  ++size_;
}

int64_t FaultLane::next() const noexcept {
  return size_ == 0 ? Transport::kNever : ring_[first_].due;
}

const Frame* FaultLane::Arrived(int64_t now) const noexcept {
  return next() <= now ? &ring_[first_].frame : nullptr;
}

void FaultLane::Pop() noexcept {
  first_ = (first_ + 1) % kCapacity;
  --size_;
}

}  // namespace plumb
