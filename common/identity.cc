#include "common/identity.h"

#include <fmt/format.h>
#include <sodium.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <system_error>

#include "common/hash.h"
#include "common/process_number.h"

namespace plumb {
namespace {

/// A number that nobody can guess, but in virtual time, where all is the same in each run.
int64_t SenderNumber(const std::string& name, const Clock& clock) {
  uint64_t number = 0;
  if (clock.is_virtual()) {
    number = Hash(fmt::format("{} {}", name, clock.Utime()));
  } else {
    if (sodium_init() < 0) throw std::runtime_error("libsodium cannot be used on this machine");
    randombytes_buf(&number, sizeof number);
  }
  return static_cast<int64_t>(number | 1);  // 0 is nobody
}

}  // namespace

Identity::Identity(const std::string& name, const std::optional<SigningKey>& key,
                   const Clock& clock, Reach reach, int64_t run)
    : key_(key),
      clock_(clock),
      reach_(reach),
      sender_(SenderNumber(name, clock)),
      process_(clock.is_virtual() ? 0 : ProcessNumber(getpid())),
      beginning_(clock.SigningUtime()),
      beginning_now_(clock.Now()),
      run_(key ? 0 : run) {}

int64_t Identity::Now() const noexcept {
  const auto passed = static_cast<double>(clock_.Now() - beginning_now_);
  return beginning_ + std::llround(passed / clock_.scale());
}

void Identity::Lead(const std::string& robot, const std::string& bus) {
  leads_ = true;
  if (key_) Join(sender_, robot, bus);
}

void Identity::Join(int64_t run, const std::string& robot, const std::string& bus) {
  run_ = run;
  robot_ = robot;
  bus_ = bus;
}

void Identity::Seal(std::string_view channel, std::span<uint8_t> message) noexcept {
  counter_ = std::max(counter_ + 1, Now());
  WriteSeal({run_, sender_, process_, counter_, {}}, key(), robot_, bus_, channel, message);
}

ChannelJudge::Verdict ChannelJudge::Hear(const Identity& me, std::string_view channel,
                                         std::span<const uint8_t> message) noexcept {
  if (!me.known()) return {};
  if (me.has_key()) return JudgeSigned(me, me.robot(), me.bus(), me.run(), channel, message);
  return JudgeSpeaker(me, FindSeal(message).value_or(Seal{}));
}

ChannelJudge::Verdict ChannelJudge::HearDriver(const Identity& me, std::string_view robot,
                                               std::string_view bus,
                                               std::span<const uint8_t> message) noexcept {
  const Seal seal = FindSeal(message).value_or(Seal{});
  if (seal.run != seal.sender) return {"not said by a driver"};
  return JudgeSigned(me, robot, bus, seal.run, kDriverChannel, message);
}

ChannelJudge::Verdict ChannelJudge::JudgeSigned(const Identity& me, std::string_view robot,
                                                std::string_view bus, int64_t run,
                                                std::string_view channel,
                                                std::span<const uint8_t> message) noexcept {
  if (run == 0) return {"its driver has not been heard yet"};
  const std::optional<Seal> seal = FindSeal(message);
  if (!seal || !Genuine(*me.key(), robot, bus, channel, message))
    return {"not signed with the driver's key, for its robot and its bus"};
  if (seal->run != run) return {"signed for another run of the driver"};
  // One from far ahead would make void all that come after it.
  if (seal->counter < me.Now() - kOldest) return {"signed too long ago: are the clocks the same?"};
  if (seal->counter > me.Now() + kClockError)
    return {"signed in the future: are the clocks the same?"};
  if (seal->counter <= std::max(newest_, me.beginning()))
    return {"signed, but a repetition, or from before we started"};
  return JudgeSpeaker(me, *seal);
}

ChannelJudge::Verdict ChannelJudge::JudgeSpeaker(const Identity& me, const Seal& seal) noexcept {
  constexpr Verdict kTwo{"said by two", true};
  latest_ = seal;
  const bool here = me.reach() == Identity::Reach::kMachine;
  if (me.leads() && here && seal.sender != 0 && seal.counter < me.Now() - kOldest &&
      !Runs(seal.process)) {
    return {"said long ago by a process that is gone: a recording"};
  }
  if (speakers_ == Speakers::kSeveral) {
    newest_ = std::max(newest_, seal.counter);
    return {};
  }
  // A log that is played tells of processes that are gone.
  const auto gone = [&](const plumb::Seal& who) {
    return here && who.process != 0 && !Runs(who.process);
  };
  if (!me.has_key() && me.run() != 0 && seal.run != me.run()) return kTwo;
  if (owned_ && seal.sender == owner_.sender && seal.process == owner_.process) {
    // Somebody else's program counts nothing.
    if (seal.sender != 0 && seal.counter <= newest_ && !gone(owner_))
      return me.reach() == Identity::Reach::kNetwork ? Verdict{"a repetition"} : kTwo;
  } else if (owned_) {
    if (here && Runs(owner_.process)) return kTwo;
    const std::span earlier = std::span(earlier_).first(num_earlier_);
    if (std::ranges::find(earlier, seal.sender) != earlier.end() && !gone(seal)) return kTwo;
    std::ranges::copy_backward(std::span(earlier_).first(earlier_.size() - 1), earlier_.end());
    earlier_[0] = owner_.sender;
    num_earlier_ = std::min(num_earlier_ + 1, earlier_.size());
  }
  owned_ = true;
  owner_ = seal;
  newest_ = seal.counter;
  return {};
}

std::string ChannelJudge::Describe(const Seal& seal) {
  if (seal.sender == 0) return "somebody who does not say who";
  if (seal.process == 0) return fmt::format("sender {:016x}", static_cast<uint64_t>(seal.sender));
  const pid_t pid = ProcessId(seal.process);
  std::error_code unreadable;  // of another user's process, or one that is gone
  std::string name;
  if (Runs(seal.process))
    name = std::filesystem::read_symlink(fmt::format("/proc/{}/exe", pid), unreadable).filename();
  std::ranges::replace_if(
      name, [](char c) { return c < ' ' || c > '~'; }, '?');
  return fmt::format("process {}{}", pid, name.empty() ? "" : " (" + name + ")");
}

}  // namespace plumb
