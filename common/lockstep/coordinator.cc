#include "common/lockstep/coordinator.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "common/lockstep/process_watch.h"
#include "common/message_bytes.h"
#include "common/time_units.h"
#include "plumb/lockstep_grant_t.hpp"

namespace plumb {
namespace {

constexpr int kGlance = 100;  // [ms] of real time between two looks at a participant that works

std::string Key(const lockstep_topic_t& topic) {
  return (topic.kind == lockstep_topic_t::FRAME ? 'f' : 'm') + topic.name;
}

}  // namespace

/// The owner's place: its turns end and begin in its calls of Wait.
class Coordinator::Owner : public Participant {
 public:
  explicit Owner(Coordinator& coordinator) : coordinator_(coordinator) { SetNow(kBeginning); }

  void Listen(const lockstep_topic_t& topic) override { coordinator_.AddListener(topic, seat); }
  void Say(const lockstep_topic_t& topic, std::vector<uint8_t> data, int64_t way) override {
    lockstep_post_t post;
    post.topic = topic;
    post.arrival = now() + way;
    post.size = static_cast<int32_t>(data.size());
    post.data = std::move(data);
    coordinator_.Route(post, seat);
  }
  void Wait(int64_t until, Wake wake, int stop_fd,
            const std::function<void()>& meanwhile) override {
    if (meanwhile) meanwhile();
    seat.until = wake == Wake::kWhenHeard && heard() ? now() : until;
    seat.wakes = wake == Wake::kWhenHeard;
    coordinator_.TakeTurns(stop_fd);
    for (; seat.heard(now()); seat.mail.pop_front()) Hear(std::move(seat.mail.front()));
  }
  void ShareProcessor() override {}  // it does
  void Note(const std::string& line) override { coordinator_.on_note(line); }
  void Fail(const std::string& why) override { coordinator_.failure_ = why; }

  void MoveOn(int64_t now) { SetNow(now); }

  LockstepMember seat;

 private:
  Coordinator& coordinator_;
};

Coordinator::Coordinator(std::string path)
    : path_(std::move(path)),
      listener_(PacketSocket::Listen(path_)),
      owner_(std::make_unique<Owner>(*this)) {}

Coordinator::~Coordinator() { unlink(path_.c_str()); }

Participant& Coordinator::participant() { return *owner_; }

int64_t Coordinator::now() const { return owner_->now(); }

LockstepMember* Coordinator::Find(const std::string& name) const {
  const auto found =
      std::ranges::find_if(members_, [&](const auto& member) { return member->name == name; });
  return found == members_.end() ? nullptr : found->get();
}

LockstepMember& Coordinator::Seat(const std::string& name) {
  if (LockstepMember* known = Find(name)) return *known;
  if (turn_ == members_.size()) ++turn_;  // the owner stays the last one
  members_.push_back(std::make_unique<LockstepMember>());
  members_.back()->name = name;
  return *members_.back();
}

void Coordinator::Expect(const std::string& name, pid_t pid) {
  LockstepMember& member = Seat(name);
  member.state = LockstepMember::State::kExpected;
  member.watch = ProcessWatch(pid);
  processor_.Release(pid);  // it has been born on ours
}

void Coordinator::Stop(const std::string& name) {
  if (LockstepMember* member = Find(name)) member->stop = true;
}

void Coordinator::Stall(const std::string& name, int64_t duration) {
  if (LockstepMember* member = Find(name)) member->stalled_until = now() + duration;
}

void Coordinator::SetClockError(const std::string& name, int64_t error) {
  if (LockstepMember* member = Find(name)) member->clock_error = error;
}

bool Coordinator::present(const std::string& name) const {
  const LockstepMember* member = Find(name);
  return member && member->state != LockstepMember::State::kAbsent;
}

bool Coordinator::AwaitEnd(const std::string& name) {
  while (present(name)) {
    Listen(-1, kGlance);
    if (!go_on()) return false;
  }
  return true;
}

/// Until the owner's turn has come.
void Coordinator::TakeTurns(int stop_fd) {
  LockstepMember& owner = owner_->seat;
  if (!Listen(stop_fd, 0)) return;
  while (Settle(stop_fd)) {
    if (!failure_.empty()) throw std::runtime_error(std::exchange(failure_, {}));
    const size_t places = members_.size() + 1;
    LockstepMember* next = nullptr;
    for (size_t i = 1; i <= places && !next; ++i) {
      const size_t place = (turn_ + i) % places;
      LockstepMember& member = place == members_.size() ? owner : *members_[place];
      if (!HasTurn(member)) continue;
      turn_ = place;
      next = &member;
    }
    if (next == &owner) return;
    if (next) {
      Grant(*next);
    } else {
      int64_t moment = owner.NextMoment();
      for (const auto& member : members_) {
        if (member->state == LockstepMember::State::kWaiting)
          moment = std::min(moment, member->NextMoment());
      }
      if (!MoveOn(moment, stop_fd)) return;
    }
  }
}

/// @return false if stop_fd has become readable meanwhile.
bool Coordinator::MoveOn(int64_t moment, int stop_fd) {
  if (max_speed > 0) {
    using std::chrono::microseconds;
    constexpr auto kSlack = std::chrono::milliseconds(100);  // that may be made up for
    const auto real_now = std::chrono::steady_clock::now();
    allowed_ = std::max(allowed_, real_now - kSlack) +
               microseconds(std::llround(static_cast<double>(moment - now()) / max_speed));
    const auto wait = std::chrono::duration_cast<std::chrono::milliseconds>(allowed_ - real_now);
    if (wait.count() > 0 && !Listen(stop_fd, static_cast<int>(wait.count()))) return false;
  }
  owner_->MoveOn(moment);
  turn_ = members_.size();  // at every moment the first one begins
  return true;
}

bool Coordinator::HasTurn(const LockstepMember& member) const {
  if (&member == &owner_->seat) return member.NextMoment() <= now();
  if (member.state != LockstepMember::State::kWaiting) return false;
  return member.NextMoment() <= now() ||
         (member.stop && !member.told && member.stalled_until <= now());
}

void Coordinator::Grant(LockstepMember& member) {
  lockstep_grant_t grant;
  grant.number = ++member.grants;
  grant.now = now();
  grant.clock_error = member.clock_error;
  grant.stop = member.stop;
  for (; member.heard(now()); member.mail.pop_front())
    grant.post.push_back(std::move(member.mail.front()));
  grant.num_posts = static_cast<int32_t>(grant.post.size());
  member.told = member.stop;
  member.state = LockstepMember::State::kWorking;
  member.watch.Begin();
  // Where it does not read any more, its end is what is read next.
  member.socket.Send(Encode(grant, buffer_), go_on);
}

/// Until nobody works, and all that was said meanwhile is on its way.
/// @return false if the wait is to end before that: then it goes on with the next one.
bool Coordinator::Settle(int stop_fd) {
  while (true) {
    LockstepMember* working = nullptr;
    int count = 0;
    for (const auto& member : members_) {
      if (!member->settled()) working = member.get(), ++count;
    }
    if (count == 0) break;
    // The rule is one who has its turn, and waiting for nobody else is the fastest.
    if (count == 1 && working->state == LockstepMember::State::kWorking) {
      Read(*working, PacketSocket::When::kSoon);
    } else if (!Listen(stop_fd, kGlance)) {
      return false;
    }
    if (std::chrono::steady_clock::now() < next_glance_) continue;
    next_glance_ = std::chrono::steady_clock::now() + std::chrono::milliseconds(kGlance);
    if (!Listen(stop_fd, 0)) return false;
    WatchProgress();
    processor_.Balance();
    if (!go_on()) return false;
  }
  for (const auto& member : members_) {
    if (member->state == LockstepMember::State::kReported) Digest(*member);
  }
  return true;
}

void Coordinator::WatchProgress() {
  for (const auto& member : members_) {
    if (member->settled()) continue;
    if (member->state == LockstepMember::State::kExpected && member->watch.dead()) {
      Leave(*member);  // it has ended before it has joined; whoever has started it knows why
      continue;
    }
    const std::string note = member->watch.Look();
    if (note.empty()) continue;
    const char* const whose = member->state == LockstepMember::State::kExpected
                                  ? "has not joined the run"
                                  : "has its turn";
    const std::string line = fmt::format("{} {} at {:.6f} s: {}", member->name, whose,
                                         Seconds(now() - kBeginning), note);
    if (member->watch.idle() > kPatience) throw std::runtime_error("given up: " + line);
    on_note(line);
  }
}

void Coordinator::AddListener(const lockstep_topic_t& topic, LockstepMember& member) {
  listeners_[Key(topic)].push_back(&member);
}

void Coordinator::Route(const lockstep_post_t& post, const LockstepMember& speaker) {
  on_post(post, speaker.name);
  const auto listeners = listeners_.find(Key(post.topic));
  if (listeners == listeners_.end()) return;
  for (LockstepMember* listener : listeners->second) {
    // On a bus nobody hears itself; LCM's messages come back.
    if (listener == &speaker && post.topic.kind == lockstep_topic_t::FRAME) continue;
    if (!on_way) {
      listener->Put(post);
      continue;
    }
    for (const lockstep_post_t& heard : on_way(post, speaker.name, listener->name))
      listener->Put(heard);
  }
}

}  // namespace plumb
