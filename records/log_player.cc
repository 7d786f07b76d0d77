#include "records/log_player.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace plumb {
namespace {

constexpr double kForever = 1e15;  // [us]; what a hostile log has between two messages, too

}  // namespace

LogPlayer::LogPlayer(const std::string& file, const Part& part, double speed, int64_t now,
                     const std::function<void(double)>& progress)
    : log_(file), index_(log_, progress), part_(part), speed_(speed), since_(now) {
  Seek(part_.from, now);
  if (over_) {
    const std::string to = part_.to < kToTheEnd ? fmt::format(" to {:g} s", part_.to) : "";
    throw std::runtime_error(fmt::format("{}: has no message from {:g} s on{}: it takes {:.6g} s",
                                         file, part_.from, to, duration()));
  }
}

// In doubles, which no hostile time overflows.
double LogPlayer::At(int64_t utime) const {
  return (static_cast<double>(utime) - static_cast<double>(index_.begin())) * 1e-6;
}

int64_t LogPlayer::Remaining(int64_t now) const {
  if (paused_) return std::llround(kForever);
  if (speed_ == 0) return 0;
  const double due = (At(next_.utime) - since_at_) / speed_ * 1e6;
  return since_ - now + std::llround(std::clamp(due, -kForever, kForever));
}

void LogPlayer::Read(int64_t now) {
  over_ = !log_.Read(next_) || At(next_.utime) > part_.to;
  // As fast as possible there is no other position than the message's.
  if (speed_ == 0 && !over_) since_ = now, since_at_ = At(next_.utime);
}

void LogPlayer::Advance(int64_t now) {
  Read(now);
  if (over_ && part_.again) Seek(part_.from, now);
}

double LogPlayer::Position(int64_t now) const {
  if (paused_ || over_ || speed_ == 0) return std::min(since_at_, duration());
  return std::min(since_at_ + static_cast<double>(now - since_) * 1e-6 * speed_, duration());
}

void LogPlayer::Pause(bool pause, int64_t now) {
  since_at_ = Position(now);
  since_ = now;
  paused_ = pause;
}

void LogPlayer::SetSpeed(double speed, int64_t now) {
  since_at_ = Position(now);
  since_ = now;
  speed_ = speed;
}

void LogPlayer::Seek(double position, int64_t now) {
  position = std::clamp(position, part_.from, std::max(part_.from, std::min(part_.to, duration())));
  since_ = now;
  since_at_ = position;
  const double utime = static_cast<double>(index_.begin()) + position * 1e6;
  if (position <= 0)
    log_.Seek(0);  // with messages that came late
  else
    index_.Seek(log_, std::llround(std::clamp(utime, -9e18, 9e18)));
  Read(now);
}

}  // namespace plumb
