#pragma once

#include <unistd.h>

#include <atomic>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/clock.h"
#include "common/lcm_url.h"
#include "tests/common/datagrams.h"
#include "tests/process/stage.h"

namespace plumb {

/// [kB] that a process has had in memory at most; -1 if it is gone.
inline int64_t MostMemory(const Child& child) {
  std::istringstream status(Read("/proc/" + std::to_string(child.pid()) + "/status"));
  for (std::string key; status >> key;) {
    int64_t kilobytes = 0;
    if (key == "VmHWM:" && status >> kilobytes) return kilobytes;
  }
  return -1;
}

/// A message as anybody can say it: without a seal, in one datagram.
template <class Message>
std::vector<uint8_t> Said(const std::string& channel, const Message& message) {
  std::string bytes(static_cast<size_t>(message.getEncodedSize()), '\0');
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return Whole(channel, bytes);
}

/// Sends datagrams to LCM's group, one after the other and again and again, as long as it lives.
class Flood {
 public:
  /// @param rate [1/s]
  Flood(const std::string& lcm_url, std::vector<std::vector<uint8_t>> datagrams, int rate)
      : sender_(ParseUdpm(lcm_url).group, ParseUdpm(lcm_url).port),
        datagrams_(std::move(datagrams)),
        rate_(rate),
        thread_([this] { Send(); }) {}
  ~Flood() {
    ended_ = true;
    thread_.join();
  }
  Flood(const Flood&) = delete;
  Flood& operator=(const Flood&) = delete;

 private:
  void Send() {
    const Clock clock;
    const int64_t start = clock.Now();
    for (int64_t sent = 0; !ended_;) {
      for (const int64_t due = (clock.Now() - start) * rate_ / 1'000'000; sent < due; ++sent)
        sender_.Send(datagrams_[static_cast<size_t>(sent) % datagrams_.size()]);
      usleep(1000);
    }
  }

  const RawSender sender_;
  const std::vector<std::vector<uint8_t>> datagrams_;
  const int64_t rate_;
  std::atomic<bool> ended_ = false;
  std::thread thread_;
};

}  // namespace plumb
