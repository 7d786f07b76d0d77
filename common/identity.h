#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/clock.h"
#include "common/seal.h"

namespace plumb {

/// On which a driver says who it is.
inline constexpr char kDriverChannel[] = "DRIVER_STATUS";

/// Who a process is on LCM: it seals what the process says, and knows whom the process is to
/// believe. Not thread-safe.
///
/// A *run* is what messages are said for. With a key it is a driver's life: the driver's random
/// number, which it hands out by its signed DRIVER_STATUS; until it has been heard, nothing else is
/// believed. Without one it is the number that `plumb launch` gives its processes, 0 for those that
/// are started by hand.
class Identity {
 public:
  /// Whose messages reach us.
  enum class Reach { kRun /* in virtual time */, kMachine, kNetwork };

  /// Nobody's: seals nothing and believes everything. For those who only look on.
  Identity() = default;
  /// @param name of the process. @param run without a key; see above.
  Identity(const std::string& name, const std::optional<SigningKey>& key, const Clock& clock,
           Reach reach, int64_t run);

  bool known() const { return sender_ != 0; }
  bool has_key() const { return key_.has_value(); }
  Reach reach() const { return reach_; }
  int64_t run() const { return run_; }
  int64_t sender() const { return sender_; }
  const std::string& robot() const { return robot_; }
  const std::string& bus() const { return bus_; }
  const SigningKey* key() const { return key_ ? &*key_ : nullptr; }
  /// Time by which counters are made and judged [us]: real time at our beginning, and now. It goes
  /// on evenly if somebody sets the clock meanwhile.
  int64_t beginning() const { return beginning_; }
  int64_t Now() const noexcept;

  /// This process is the driver, and obeys no recording; with a key, it hands out the run.
  void Lead(const std::string& robot, const std::string& bus);
  bool leads() const { return leads_; }
  /// With a key: takes part in the run of this robot's driver only. @param robot its name.
  void Follow(const std::string& robot) { wanted_robot_ = robot; }
  /// Whether a driver of that robot may lead this process.
  bool Follows(const std::string& robot) const {
    return !leads_ && (wanted_robot_.empty() || wanted_robot_ == robot);
  }
  /// With a key: from now on takes part in the run of a driver whose DRIVER_STATUS was genuine.
  void Join(int64_t run, const std::string& robot, const std::string& bus);

  /// Fills in the last kSealSize bytes of a message that is to be said on a channel.
  void Seal(std::string_view channel, std::span<uint8_t> message) noexcept;

 private:
  std::optional<SigningKey> key_;
  Clock clock_;
  Reach reach_ = Reach::kRun;
  int64_t sender_ = 0, process_ = 0, counter_ = 0;
  int64_t beginning_ = 0, beginning_now_ = 0;  // the same moment, by Clock::Now
  int64_t run_ = 0;
  bool leads_ = false;
  std::string robot_, bus_, wanted_robot_;
};

/// How many may speak on a channel at a time. Only wishes of people may come from several.
enum class Speakers { kOne, kSeveral };

/// Judges the messages of one channel as they arrive. Neither allocates nor blocks nor throws. Not
/// thread-safe.
///
/// A channel belongs to whoever speaks on it first, and to a later one when that process is gone.
/// If somebody else speaks on it while its owner runs, or an earlier owner speaks again, there are
/// two: none of them can be told from a forger.
class ChannelJudge {
 public:
  /// Age at which a signed message is void, however it was held up [us].
  static constexpr int64_t kOldest = 10'000'000;
  /// That the sender's clock may be ahead of ours [us].
  static constexpr int64_t kClockError = 1'000'000;

  struct Verdict {
    std::string_view refusal;  ///< why it is not to be believed, a literal; empty: it is
    bool two_speakers = false;
  };

  explicit ChannelJudge(Speakers speakers = Speakers::kOne) : speakers_(speakers) {}

  /// @param message as it was received on the channel.
  Verdict Hear(const Identity& me, std::string_view channel,
               std::span<const uint8_t> message) noexcept;
  /// The same for a message that says itself for which run, robot and bus it is: a driver's.
  Verdict HearDriver(const Identity& me, std::string_view robot, std::string_view bus,
                     std::span<const uint8_t> message) noexcept;

  /// "process 4711 (plumb-controller)" of the channel's owner and of the one who was heard last,
  /// for people; allocates.
  std::string owner() const { return Describe(owner_); }
  std::string latest() const { return Describe(latest_); }

 private:
  Verdict JudgeSigned(const Identity& me, std::string_view robot, std::string_view bus, int64_t run,
                      std::string_view channel, std::span<const uint8_t> message) noexcept;
  Verdict JudgeSpeaker(const Identity& me, const Seal& seal) noexcept;
  static std::string Describe(const Seal& seal);

  Speakers speakers_;
  bool owned_ = false;
  Seal owner_, latest_;
  int64_t newest_ = 0;                 // counter of the newest message believed
  std::array<int64_t, 16> earlier_{};  // owners, by sender
  size_t num_earlier_ = 0;
};

}  // namespace plumb
