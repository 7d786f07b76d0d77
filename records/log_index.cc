#include "records/log_index.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <stdexcept>
#include <system_error>

namespace plumb {
namespace {

constexpr int64_t kBetweenPlaces = 1000;  // messages

}  // namespace

LogIndex::LogIndex(LcmLogReader& log, const std::function<void(double)>& progress) {
  std::error_code error;  // of what is no file, or gone: then nobody is told
  const auto size = static_cast<double>(std::filesystem::file_size(log.file(), error));
  log.Seek(0);
  int64_t latest = std::numeric_limits<int64_t>::min(), utime = 0;
  for (;;) {
    if (messages_ % kBetweenPlaces == 0) {
      places_.push_back({log.position(), latest});
      if (progress && !error) progress(std::min(1., static_cast<double>(log.position()) / size));
    }
    if (!log.Skip(utime)) break;
    if (messages_++ == 0) begin_ = utime;
    latest = std::max(latest, utime);
  }
  cut_off_ = log.cut_off();
  end_ = latest;
  if (messages_ == 0) throw std::runtime_error(log.file() + ": has no message");
  log.Seek(0);
}

void LogIndex::Seek(LcmLogReader& log, int64_t utime) const {
  // The first place whose earlier messages may be of that time: the one before it is not too late.
  const auto after = std::ranges::partition_point(
      places_, [&](const Place& place) { return place.latest < utime; });
  log.Seek(after == places_.begin() ? 0 : std::prev(after)->position);
  for (int64_t at = log.position(), time = 0; log.Skip(time); at = log.position()) {
    if (time < utime) continue;
    log.Seek(at);
    return;
  }
}

}  // namespace plumb
