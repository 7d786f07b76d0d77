#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace plumb {

/// Keeps a log from being filled by whoever makes a process say the same again and again. Lines are
/// of one kind if they begin alike, up to the first digit, colon or quotation mark: what the
/// program says, without what it says it of. Each kind may have kBurst lines at once, and then one
/// a second: of lines of 200 bytes 17 MB a day. There are kMaxKinds kinds, and one of all others.
/// Not thread-safe.
class LogLimit {
 public:
  static constexpr int kBurst = 100;
  static constexpr int64_t kPeriod = 1'000'000;  ///< [us]
  static constexpr size_t kMaxKinds = 100;

  /// @param now monotonic [us]. @return nothing if the line is not to be written; else how many of
  /// its kind have not been since the last that was.
  std::optional<int64_t> Admit(std::string_view line, int64_t now);

 private:
  struct Kind {
    int64_t full_again;  // when kBurst lines may be written at once
    int64_t held_back = 0;
  };
  std::map<std::string, Kind, std::less<>> kinds_;
};

}  // namespace plumb
