// A process's end of the coordinator's socket.

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <utility>

#include "common/lockstep/coordinator.h"
#include "common/lockstep/packet_socket.h"
#include "common/lockstep/participant.h"
#include "common/message_bytes.h"
#include "common/program_version.h"
#include "plumb/lockstep_grant_t.hpp"
#include "plumb/lockstep_hello_t.hpp"
#include "plumb/lockstep_report_t.hpp"

namespace plumb {
namespace {

class RemoteParticipant : public Participant {
 public:
  RemoteParticipant(const std::string& path, const std::string& name)
      : path_(path), socket_(PacketSocket::Connect(path)) {
    lockstep_hello_t hello;
    hello.version = ProgramVersion();
    hello.name = name;
    hello.pid = getpid();
    Send(hello);
    AwaitGrant(-1);
    begins_run_ = now() == Coordinator::kBeginning;
    if (!grant_.refusal.empty()) throw std::runtime_error(path + ": " + grant_.refusal);
  }

  ~RemoteParticipant() override {
    report_.leaves = 1;
    Complete(now(), Wake::kOnTime);
    socket_.Send(Encode(report_, buffer_));
  }

  void Listen(const lockstep_topic_t& topic) override { report_.topic.push_back(topic); }

  void Say(const lockstep_topic_t& topic, std::vector<uint8_t> data, int64_t way) override {
    lockstep_post_t& post = report_.post.emplace_back();
    post.topic = topic;
    post.arrival = now() + way;
    post.size = static_cast<int32_t>(data.size());
    post.data = std::move(data);
  }

  void Wait(int64_t until, Wake wake, int stop_fd,
            const std::function<void()>& meanwhile) override {
    // Messages that have been heard and not been read are read first; no time passes meanwhile.
    if (wake == Wake::kWhenHeard && heard()) until = now();
    Report(until, wake);
    if (meanwhile) meanwhile();
    AwaitGrant(stop_fd);
  }

  void ShareProcessor() override { report_.shares_processor = 1; }
  void Note(const std::string& line) override {
    report_.note += (report_.note.empty() ? "" : "; ") + line;
  }
  void Fail(const std::string& why) override { report_.failure = why; }

 private:
  template <class Message>
  void Send(const Message& message) {
    if (!socket_.Send(Encode(message, buffer_))) Gone();
  }

  void Complete(int64_t until, Wake wake) {
    report_.grant = grant_.number;
    report_.until = until;
    report_.wakes = wake == Wake::kWhenHeard;
    report_.num_topics = static_cast<int32_t>(report_.topic.size());
    report_.num_posts = static_cast<int32_t>(report_.post.size());
  }

  void Report(int64_t until, Wake wake) {
    Complete(until, wake);
    Send(report_);
    report_ = {};
  }

  /// Until our turn has come. A signal asks for it, where it does not come anyway.
  void AwaitGrant(int stop_fd) {
    bool asked = false;
    std::span<const uint8_t> packet;
    while (true) {
      if (!socket_.Read(PacketSocket::When::kSoon)) Gone();
      packet = socket_.Next();
      if (!packet.empty()) break;
      pollfd stop{stop_fd, POLLIN, 0};
      if (asked || poll(&stop, 1, 0) <= 0) continue;
      asked = true;
      Report(now(), Wake::kWhenHeard);
    }
    if (!Decode(packet, grant_)) throw std::runtime_error(path_ + ": the run is another version's");
    SetNow(grant_.now);
    SetClockError(grant_.clock_error);
    stopping_ = stopping_ || grant_.stop;
    for (lockstep_post_t& post : grant_.post) Hear(std::move(post));
  }

  [[noreturn]] void Gone() const {
    throw std::runtime_error(path_ + ": the run has ended, or refuses this process");
  }

  std::string path_;
  PacketSocket socket_;
  std::vector<uint8_t> buffer_;
  lockstep_report_t report_{};  // that is being made
  lockstep_grant_t grant_{};    // the last one
};

}  // namespace

std::unique_ptr<Participant> JoinRun(const std::string& path, const std::string& name) {
  return std::make_unique<RemoteParticipant>(path, name);
}

}  // namespace plumb
