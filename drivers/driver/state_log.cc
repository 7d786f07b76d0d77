#include "drivers/driver/state_log.h"

#include <poll.h>

#include <utility>

namespace plumb {

StateLog::StateLog(int fd, Write write, WriteLost lost)
    : fd_(fd), write_(std::move(write)), write_lost_(std::move(lost)) {}

void StateLog::Note(int8_t state, std::string_view reason) noexcept {
  if (state == newest_.state && reason == newest_.reason.text()) return;
  newest_.state = state;
  newest_.reason.Set("{}", reason);
  if (count_ == kCapacity) {
    head_ = (head_ + 1) % kCapacity;
    --count_;
    ++lost_;
  }
  ring_[(head_ + count_++) % kCapacity] = newest_;
}

void StateLog::Drain() {
  while (count_ > 0 && ready()) {
    if (const int64_t lost = std::exchange(lost_, 0); lost > 0) {
      write_lost_(lost);
      continue;
    }
    const Entry& entry = ring_[head_];
    write_(entry.state, entry.reason.text());
    head_ = (head_ + 1) % kCapacity;
    --count_;
  }
}

bool StateLog::ready() const noexcept {
  // A pipe is writable when it has room for PIPE_BUF bytes, which no line of ours exceeds.
  pollfd polled{fd_, POLLOUT, 0};
  return poll(&polled, 1, 0) == 1;
}

}  // namespace plumb
