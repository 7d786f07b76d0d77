#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

namespace plumb {

/// How much is said on each channel of LCM, how evenly, and how much of it does not decode.
/// Channels come from outside: beyond kMaxChannels none but ChannelsOfPage are listed. Not
/// thread-safe.
class ChannelStatistics {
 public:
  static constexpr size_t kMaxChannels = 200;

  /// What was made of a message.
  enum class Verdict { kGood, kUndecodable, kRefused };

  /// @param type "robot_state_t"; empty: none of ours. @param arrival monotonic [us].
  void Add(std::string_view channel, std::string_view type, size_t bytes, int64_t arrival,
           Verdict verdict);
  /// Call twice a second: rates are of the last kParts calls. @param now monotonic [us].
  /// "intervals" are counts since the beginning: bin i has those of [2^i, 2^(i+1)) us, the last
  /// also all that are longer.
  /// @return {"utime":..,"channels":[..]}
  std::string Json(int64_t utime, int64_t now);

 private:
  static constexpr size_t kBins = 24;
  static constexpr size_t kParts = 4;  // of the time over which rates are taken
  struct Part {
    int64_t messages = 0, bytes = 0, intervals = 0;
    double sum = 0, square = 0;  // of the intervals between arrivals [us], [us^2]
  };
  struct Channel {
    std::string type;
    int64_t count = 0, undecodable = 0, refused = 0;
    int64_t last = -1;  // arrival
    std::array<int64_t, kBins> intervals{};
    std::array<Part, kParts> parts{};
  };
  std::map<std::string, Channel, std::less<>> channels_;
  std::array<int64_t, kParts> began_{};  // of each part, 0 = not yet
  size_t part_ = 0;                      // under way
};

}  // namespace plumb
