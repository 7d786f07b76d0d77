#include "dashboard/run_time.h"

#include <algorithm>

#include "common/identity.h"
#include "robot/physical.h"

namespace plumb {

void RunTime::OnMessage(int64_t utime, const std::optional<Seal>& seal, int64_t date, int64_t now) {
  if (utime < 0 || !IsTime(utime)) return;
  utime_ = std::max(utime_, utime);  // processes' words come a little out of order
  if (seal) {
    heard_ = seal->process == 0                             ? Kind::kVirtual
             : seal->counter < date - ChannelJudge::kOldest ? Kind::kReplay
                                                            : Kind::kReal;
  }
  if (moments_.empty() || now >= moments_.back().now + kStep) moments_.push_back({now, utime_});
}

void RunTime::Rewind(int64_t utime) {
  utime_ = utime;
  moments_.clear();
}

double RunTime::Speed(int64_t now) {
  while (moments_.size() > 1 && moments_.front().now < now - kWindow) moments_.pop_front();
  if (moments_.empty() || now <= moments_.front().now) return 0;
  const Moment& first = moments_.front();
  return static_cast<double>(utime_ - first.utime) / static_cast<double>(now - first.now);
}

std::string_view RunTime::kind_name() const {
  return kind() == Kind::kVirtual ? "virtual" : kind() == Kind::kReplay ? "replay" : "real";
}

}  // namespace plumb
