#include "estimator/imu_inbox.h"

#include <algorithm>
#include <cmath>

#include "robot/physical.h"

namespace plumb {
namespace {

bool Sane(const imu_t& imu) {
  if (imu.utime < 0 || !IsTime(imu.utime)) return false;
  if (!std::ranges::all_of(imu.rate, IsPhysical) || !std::ranges::all_of(imu.force, IsPhysical))
    return false;
  double norm = 0;
  for (const double x : imu.orientation) norm += x * x;
  return !imu.orientation_valid || std::abs(norm - 1) < 0.01;
}

}  // namespace

ImuInbox::Verdict ImuInbox::Put(const imu_t& imu, int64_t state_utime) {
  if (!Sane(imu)) return Verdict::kRefused;
  if (state_utime > 0 && (state_utime - imu.utime > kLatest || imu.utime - state_utime > kAhead))
    return Verdict::kRefused;
  const auto seen = std::span(seen_).first(std::min(remembered_, kRoom));
  if (std::ranges::find(seen, imu.utime) != seen.end()) return Verdict::kDuplicate;
  if (count_ == kRoom) return Verdict::kRefused;
  seen_[remembered_++ % kRoom] = imu.utime;

  size_t at = count_++;
  while (at > 0 && readings_[at - 1].utime < imu.utime) {
    readings_[at] = readings_[at - 1];
    --at;
  }
  Reading& reading = readings_[at];
  reading.utime = imu.utime;
  std::copy(std::begin(imu.rate), std::end(imu.rate), reading.rate.begin());
  std::copy(std::begin(imu.force), std::end(imu.force), reading.force.begin());
  std::copy(std::begin(imu.orientation), std::end(imu.orientation), reading.orientation.begin());
  reading.orientation_valid = imu.orientation_valid;
  reading.rate_clipped = imu.rate_clipped;
  reading.force_clipped = imu.force_clipped;
  const bool late = imu.utime < newest_;
  newest_ = std::max(newest_, imu.utime);
  return late ? Verdict::kReordered : Verdict::kTaken;
}

const ImuInbox::Reading* ImuInbox::Take(int64_t utime) {
  if (count_ == 0 || readings_[count_ - 1].utime > utime) return nullptr;
  taken_ = readings_[--count_];
  return &taken_;
}

}  // namespace plumb
