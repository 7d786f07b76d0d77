// Who joins a run, what participants report, and who leaves it.

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <utility>

#include "common/lockstep/coordinator.h"
#include "common/message_bytes.h"
#include "common/program_version.h"
#include "common/time_units.h"
#include "plumb/lockstep_grant_t.hpp"
#include "plumb/lockstep_hello_t.hpp"

namespace plumb {

/// Reads what has come. @return false if stop_fd is readable.
bool Coordinator::Listen(int stop_fd, int timeout) {
  polled_.clear();
  polled_.push_back({stop_fd, POLLIN, 0});
  polled_.push_back({listener_.fd(), POLLIN, 0});
  for (const auto& stranger : strangers_) polled_.push_back({stranger.fd(), POLLIN, 0});
  for (const auto& member : members_) polled_.push_back({member->socket.fd(), POLLIN, 0});
  if (poll(polled_.data(), polled_.size(), timeout) > 0) {
    const size_t first_member = 2 + strangers_.size();
    for (size_t i = 0; i + first_member < polled_.size(); ++i) {
      if (polled_[i + first_member].revents != 0) Read(*members_[i], PacketSocket::When::kNow);
    }
    for (size_t i = 2; i < first_member; ++i) {
      if (polled_[i].revents != 0) Admit(strangers_[i - 2]);
    }
    std::erase_if(strangers_, [](const PacketSocket& stranger) { return !stranger.open(); });
    if (polled_[1].revents != 0) strangers_.push_back(listener_.Accept());
  }
  return stop_fd < 0 || polled_[0].revents == 0;
}

/// A stranger has said something, or has gone: it joins, or is refused.
void Coordinator::Admit(PacketSocket& stranger) {
  if (!stranger.Read(PacketSocket::When::kNow)) return stranger.Close();
  const std::span<const uint8_t> packet = stranger.Next();
  if (packet.empty()) return;
  lockstep_hello_t hello;
  lockstep_grant_t welcome{};
  welcome.now = now();
  if (!Decode(packet, hello)) {
    welcome.refusal = "the run is another version's";
  } else if (hello.version != ProgramVersion()) {
    welcome.refusal = fmt::format("{} is {}, the run is {}: build both together", hello.name,
                                  hello.version, ProgramVersion());
  } else if (const LockstepMember* known = Find(hello.name); known && known->socket.open()) {
    welcome.refusal = fmt::format("there is a {} in the run already", hello.name);
  }
  stranger.Send(Encode(welcome, buffer_), go_on);
  if (!welcome.refusal.empty()) {
    on_note(fmt::format("refused: {}", welcome.refusal));
    return stranger.Close();
  }
  LockstepMember& member = Seat(hello.name);
  const std::string name = std::move(member.name);
  member = LockstepMember();
  member.name = name;
  member.socket = std::move(stranger);
  member.state = LockstepMember::State::kWorking;
  member.pid = hello.pid;
  member.watch = ProcessWatch(hello.pid);
}

void Coordinator::Read(LockstepMember& member, PacketSocket::When when) {
  const bool there = member.socket.Read(when);
  for (std::span<const uint8_t> packet; !(packet = member.socket.Next()).empty();) {
    lockstep_report_t report;
    if (!Decode(packet, report)) {
      on_note(member.name + " says what is no report");
      return Leave(member);
    }
    // it asked for a turn that it has been given meanwhile
    if (report.grant != member.grants) continue;
    if (member.state == LockstepMember::State::kWaiting) {
      member.until = std::min(member.until, now());  // a signal has come: it wants to look at it
    } else {
      member.report = std::move(report);
      member.state = LockstepMember::State::kReported;
    }
  }
  if (there || (member.state == LockstepMember::State::kReported && member.report.leaves)) return;
  on_note(fmt::format("{} has died at {:.6f} s", member.name, Seconds(now() - kBeginning)));
  Leave(member);
}

/// Its turn is over: the others hear what it has said.
void Coordinator::Digest(LockstepMember& member) {
  const lockstep_report_t report = std::exchange(member.report, {});
  member.state = LockstepMember::State::kWaiting;
  member.until = report.until;
  member.wakes = report.wakes;
  for (const lockstep_topic_t& topic : report.topic) AddListener(topic, member);
  for (const lockstep_post_t& post : report.post) Route(post, member);
  if (report.shares_processor) processor_.Add(member.pid);
  if (!report.note.empty()) on_note(member.name + ": " + report.note);
  if (!report.failure.empty()) failure_ = member.name + ": " + report.failure;
  if (report.leaves) Leave(member);
}

void Coordinator::Leave(LockstepMember& member) {
  processor_.Remove(member.pid);
  member.socket.Close();
  member.state = LockstepMember::State::kAbsent;
  member.mail.clear();
  for (auto& [key, listeners] : listeners_) std::erase(listeners, &member);
}

}  // namespace plumb
