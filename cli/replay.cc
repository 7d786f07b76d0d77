#include "cli/replay.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <iostream>
#include <optional>
#include <stdexcept>

#include "cli/keyboard.h"
#include "common/lcm_url.h"
#include "common/name_lock.h"
#include "common/progress_line.h"
#include "records/listeners.h"
#include "records/pacing.h"

namespace plumb {
namespace {

constexpr char kDriver[] = "DRIVER_STATUS";
constexpr int64_t kListen = 350'000;    // [us]; a driver speaks every 100 ms
constexpr int64_t kLook = 50'000;       // [us] between two looks at keys and LCM
constexpr int kBurst = 100;             // messages between them, if they are due at once
constexpr size_t kMostSaid = 100'000;   // statuses on their way
constexpr double kJump = 5, kFar = 60;  // [s] of the log
constexpr double kSlowest = 1.0 / 64, kFastest = 64;

/// Tells a driver's statuses from those that we have said ourselves and hear again.
class DriverWatch {
 public:
  explicit DriverWatch(Messenger& messenger)
      : subscription_(messenger.Subscribe(
            kDriver, [this](const auto&, std::span<const uint8_t> bytes) { OnStatus(bytes); })) {}

  void Said(std::span<const uint8_t> bytes) {
    said_.emplace_back(bytes.begin(), bytes.end());
    if (said_.size() > kMostSaid) said_.pop_front();
  }
  /// Whether somebody else has.
  bool heard() const { return heard_; }

 private:
  // They come back in order, if they come back: those before it have not.
  void OnStatus(std::span<const uint8_t> bytes) {
    const auto ours = std::ranges::find_if(
        said_, [&](const auto& said) { return std::ranges::equal(said, bytes); });
    if (ours == said_.end())
      heard_ = true;
    else
      said_.erase(said_.begin(), std::next(ours));
  }

  std::deque<std::vector<uint8_t>> said_;
  bool heard_ = false;
  std::unique_ptr<Messenger::Subscription> subscription_;  // ends first
};

/// Asked to stop before anything was said.
struct Stopped {};

class Replayer {
 public:
  Replayer(Process& process, const ReplayFlags& flags)
      : process_(process),
        from_(flags.part.from),
        player_(flags.log, flags.part, flags.speed, Now(),
                [&](double share) {
                  if (process_.stopping()) throw Stopped();
                  line_.Show("looking through " + flags.log, share);
                }),
        messenger_(process.messenger()),
        drivers_(messenger_) {
    line_.Clear();
    const std::string& url = process.lcm_url();
    if (url.starts_with("udpm:")) {
      pacing_.emplace(
          [listeners = Listeners(ParseUdpm(url).port)]() mutable { return listeners.Look(); });
    }
    if (player_.index().cut_off()) spdlog::warn("{}: its last message is cut off", flags.log);
  }

  int Run() {
    for (const int64_t until = Now() + kListen; Now() < until;) {
      if (!process_.Wait(until - Now())) return 130;
      if (drivers_.heard()) return RefuseDriver();
    }
    const int64_t begin = Now();
    player_.Seek(from_, begin);
    while (!player_.over()) {
      if (!Obey()) break;
      if (!Rest()) return Conclude(130, begin);
      if (drivers_.heard()) return RefuseDriver();
      SayWhatIsDue();
    }
    return Conclude(0, begin);
  }

 private:
  int64_t Now() const { return process_.clock().Now(); }

  void SayWhatIsDue() {
    for (int i = 0; i < kBurst && !player_.over() && player_.Remaining(Now()) <= 0; ++i) {
      const LcmLogEvent& event = player_.next();
      if (pacing_ && !pacing_->MaySend(event.data.size())) {
        full_ = true;
        break;
      }
      if (event.channel == kDriver) drivers_.Said(event.data);
      if (!messenger_.Publish(event.channel, event.data))
        throw std::runtime_error(fmt::format("LCM: {} could not be sent", event.channel));
      ++said_;
      player_.Advance(Now());
    }
    if (pacing_ && pacing_->standing_still() > still_)
      spdlog::warn("a listener takes nothing of what it is sent: it is not waited for");
    if (pacing_) still_ = pacing_->standing_still();
    Show();
  }

  /// Until something is due. @return false when asked to stop.
  bool Rest() {
    const int64_t due = std::clamp<int64_t>(player_.Remaining(Now()), 0, kLook);
    const int64_t rest = std::exchange(full_, false) ? std::max(due, Pacing::kNap) : due;
    return process_.Wait(rest, std::array{keyboard_.fd()});
  }

  /// @return false if the keys say so.
  bool Obey() {
    for (const Key key : keyboard_.Take()) {
      const int64_t now = Now();
      const double position = player_.Position(now), speed = player_.speed();
      switch (key) {
        case Key::kPause:
          player_.Pause(!player_.paused(), now);
          break;
        case Key::kBack:
          player_.Seek(position - kJump, now);
          break;
        case Key::kForth:
          player_.Seek(position + kJump, now);
          break;
        case Key::kFarBack:
          player_.Seek(position - kFar, now);
          break;
        case Key::kFarForth:
          player_.Seek(position + kFar, now);
          break;
        case Key::kBeginning:
          player_.Seek(0, now);
          break;
        case Key::kFaster:
          player_.SetSpeed(Faster(speed), now);
          break;
        case Key::kSlower:
          player_.SetSpeed(Slower(speed), now);
          break;
        case Key::kQuit:
          return false;
      }
    }
    return true;
  }

  void Show() {
    if (!line_.shown() || Now() - shown_ < kLook) return;
    shown_ = Now();
    const std::string speed =
        player_.speed() == 0 ? "as fast as possible" : fmt::format("{:g}x", player_.speed());
    line_.Show(
        fmt::format("{:.1f} of {:.1f} s, {}   space: pause, arrows: {:g} and {:g} s, +/-: "
                    "speed, q: end",
                    player_.Position(shown_), player_.duration(),
                    player_.paused() ? "paused" : speed, kJump, kFar));
  }

  int RefuseDriver() {
    line_.Clear();
    std::cerr << "plumb: a driver speaks on " << process_.lcm_url()
              << ": no robot is to hear a recording. Cure: give --lcm-url another group, as "
                 "udpm://239.255.76.68:7668?ttl=0, to replay and to its listeners"
              << std::endl;
    return 1;
  }

  int Conclude(int status, int64_t begin) {
    line_.Clear();
    std::cout << fmt::format("{} of {} messages said in {:.1f} s", said_,
                             player_.index().messages(), static_cast<double>(Now() - begin) * 1e-6)
              << std::endl;
    const uint64_t lost = pacing_ ? pacing_->Lost() : 0;
    if (lost == 0) return status;
    std::cerr << fmt::format("plumb: listeners on this machine have lost {} datagrams: {}", lost,
                             "their buffers are smaller than most, or they stood still")
              << std::endl;
    return 1;
  }

  Process& process_;
  ProgressLine line_{true, std::cout};
  const double from_;
  LogPlayer player_;
  Messenger& messenger_;
  DriverWatch drivers_;
  Keyboard keyboard_;
  std::optional<Pacing> pacing_;  // only UDP needs it
  int64_t said_ = 0, shown_ = 0;
  bool full_ = false;  // a listener's buffer
  int still_ = 0;      // listeners that take nothing
};

}  // namespace

double Faster(double speed) { return std::max(speed, std::min(2 * speed, kFastest)); }

double Slower(double speed) {
  return speed == 0 ? kFastest : std::min(speed, std::max(speed / 2, kSlowest));
}

int Replay(Process& process, const ReplayFlags& flags) {
  if (process.participant())
    throw std::invalid_argument("nobody outside takes part in a run in virtual time: no --clock");
  // Two speakers on a channel end whoever listens: one run or replay at a time.
  std::optional<NameLock> lock;
  if (const std::string& url = process.lcm_url(); !url.starts_with("memq:")) {
    lock.emplace("messages " + LcmGroup(url),
                 "a run or a replay is under way on " + url + ": stop it, or give --lcm-url");
  }
  try {
    return Replayer(process, flags).Run();
  } catch (const Stopped&) {
    return 130;
  }
}

}  // namespace plumb
