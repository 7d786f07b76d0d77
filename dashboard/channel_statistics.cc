#include "dashboard/channel_statistics.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "common/message_json.h"
#include "common/time_units.h"
#include "dashboard/channels.h"

namespace plumb {

void ChannelStatistics::Add(std::string_view name, std::string_view type, size_t bytes,
                            int64_t arrival, Verdict verdict) {
  auto found = channels_.find(name);
  if (found == channels_.end()) {
    if (channels_.size() >= kMaxChannels && !IsChannelOfPage(name)) return;
    found = channels_.emplace(name, Channel{}).first;
  }
  Channel& channel = found->second;
  if (channel.type != type) channel.type = type;
  ++channel.count;
  if (verdict == Verdict::kUndecodable) ++channel.undecodable;
  if (verdict == Verdict::kRefused) ++channel.refused;
  if (began_[part_] == 0) began_[part_] = arrival;
  Part& part = channel.parts[part_];
  ++part.messages;
  part.bytes += static_cast<int64_t>(bytes);
  if (channel.last >= 0) {
    const auto interval = static_cast<double>(arrival - channel.last);
    ++part.intervals;
    part.sum += interval;
    part.square += interval * interval;
    const auto us = static_cast<uint64_t>(std::max<int64_t>(arrival - channel.last, 1));
    ++channel.intervals[std::min<size_t>(std::bit_width(us) - 1, kBins - 1)];
  }
  channel.last = arrival;
}

std::string ChannelStatistics::Json(int64_t utime, int64_t now) {
  int64_t began = now;
  for (const int64_t begin : began_) {
    if (begin != 0) began = std::min(began, begin);
  }
  const double seconds = std::max(Seconds(now - began), 1e-3);
  std::string json = fmt::format(R"({{"utime":{},"channels":[)", utime);
  for (auto& [name, channel] : channels_) {
    Part all;
    for (const Part& part : channel.parts) {
      all.messages += part.messages, all.bytes += part.bytes, all.intervals += part.intervals;
      all.sum += part.sum, all.square += part.square;
    }
    const auto intervals = static_cast<double>(all.intervals);
    const double mean = all.sum / intervals, square = all.square / intervals;
    const double jitter = std::sqrt(std::max(square - mean * mean, 0.));
    if (json.back() != '[') json += ',';
    json += R"({"channel":)";
    AppendJsonText(name, json);
    json += fmt::format(R"(,"type":"{}","count":{},"rate":)", channel.type, channel.count);
    AppendJsonNumber(static_cast<double>(all.messages) / seconds, json);
    json += R"(,"jitter_ms":)";
    AppendJsonNumber(all.intervals > 1 ? jitter / 1000 : std::nan(""), json);
    json += R"(,"bytes_per_second":)";
    AppendJsonNumber(static_cast<double>(all.bytes) / seconds, json);
    json += fmt::format(R"(,"undecodable":{},"refused":{},"intervals":[{}],"age_ms":)",
                        channel.undecodable, channel.refused, fmt::join(channel.intervals, ","));
    AppendJsonNumber(static_cast<double>(now - channel.last) / 1000, json);
    json += '}';
  }
  part_ = (part_ + 1) % kParts;
  began_[part_] = now;
  for (auto& [name, channel] : channels_) channel.parts[part_] = {};
  return json + "]}";
}

}  // namespace plumb
