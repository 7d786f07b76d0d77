#pragma once

#include <cstdint>
#include <vector>

#include "common/random.h"
#include "drivers/can/faults.h"
#include "drivers/can/frame.h"

namespace plumb {

/// Frames under way in one direction of a faulty bus, with what happens to them. Allocates only
/// when it is constructed. Times are microseconds. Not thread-safe.
class FaultLane {
 public:
  static constexpr size_t kCapacity = 4096;

  /// @param stream names the random numbers together with the seed.
  FaultLane(const Faults::Side& side, uint64_t seed, uint32_t stream);

  /// Frames that may be added with Add, whatever happens to them; each counts twice, as it may be
  /// doubled.
  size_t room() const noexcept { return size_ + 2 > kCapacity ? 0 : (kCapacity - size_ - 2) / 2; }
  /// A frame sets out, and meets its fate. Needs room.
  void Add(const Frame& frame, int64_t now) noexcept;
  /// A frame that nothing happens to, not before those already under way. Dropped if there is no
  /// room.
  void Append(const Frame& frame, int64_t due) noexcept;

  /// When the next frame arrives; Transport::kNever if none is under way.
  int64_t next() const noexcept;
  /// The next frame if it has arrived, else null; valid until the next call.
  const Frame* Arrived(int64_t now) const noexcept;
  void Pop() noexcept;

  int64_t injected() const noexcept { return injected_; }

 private:
  struct Entry {
    Frame frame;
    int64_t due;
  };

  Faults::Side side_;
  Random random_;
  std::vector<Entry> ring_;
  size_t first_ = 0, size_ = 0;
  int64_t last_due_ = 0;
  Frame held_;      // lets the next frame pass
  int copies_ = 0;  // of held_; 0: nobody is held
  int64_t injected_ = 0;
};

}  // namespace plumb
