#include "drivers/driver/state_log.h"

#include <poll.h>

namespace plumb {

StateLog::StateLog(int fd, Write write) : fd_(fd), write_(std::move(write)) {}

void StateLog::Note(int8_t state, std::string_view reason) noexcept {
  if (state == newest_.state && reason == newest_.reason.text()) return;
  newest_.state = state;
  newest_.reason.Set("{}", reason);
  if (count_ == kCapacity) {
    head_ = (head_ + 1) % kCapacity;
    --count_;
    ++dropped_;
  }
  ring_[(head_ + count_++) % kCapacity] = newest_;
}

void StateLog::Drain() {
  while (count_ > 0 && ready()) {
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
