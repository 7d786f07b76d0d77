#include "bench/realtime/floor.h"

#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <functional>
#include <stdexcept>

#include "common/clock.h"
#include "common/messenger.h"
#include "common/time_units.h"
#include "plumb/joint_state_t.hpp"

namespace plumb {
namespace {

constexpr int64_t kPeriod = 1000;       // [us]
constexpr int64_t kPatience = 100'000;  // [us] until an answer counts as lost

/// A process that does this and dies with us.
pid_t Fork(const std::function<void()>& work) {
  const pid_t pid = fork();
  if (pid < 0) throw std::runtime_error("cannot fork");
  if (pid > 0) return pid;
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  work();
  _exit(0);
}

void End(pid_t pid) {
  kill(pid, SIGKILL);
  waitpid(pid, nullptr, 0);
}

joint_state_t Message() {
  joint_state_t message{};
  message.num_joints = 1;
  message.measured.resize(1);
  message.valid.resize(1);
  for (auto* values : {&message.position, &message.velocity, &message.effort_measured,
                       &message.effort_sent, &message.effort_applied}) {
    values->resize(1);
  }
  return message;
}

void Echo(const std::string& lcm_url) {
  Messenger messenger(lcm_url);
  Publisher<joint_state_t> pong(messenger, "PONG");
  Subscriber<joint_state_t> ping(messenger, "PING",
                                 [&](const joint_state_t& message) { pong.Publish(message); });
  for (;; messenger.Drain()) messenger.Await(-1);
}

}  // namespace

Load::Load(int processes) {
  while (static_cast<int>(burning_.size()) < processes) {
    burning_.push_back(Fork([] {
      for (volatile uint64_t i = 0;;) i = i + 1;
    }));
  }
}

Load::~Load() {
  for (const pid_t pid : burning_) End(pid);
}

Realtime::Realtime(int priority) {
  if (priority == 0) return;
  const sched_param parameter{.sched_priority = priority};
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0 ||
      sched_setscheduler(0, SCHED_FIFO, &parameter) != 0) {
    throw std::runtime_error(std::string("SCHED_FIFO: ") + std::strerror(errno) +
                             "; cure: run as root");
  }
}

Realtime::~Realtime() {
  const sched_param parameter{.sched_priority = 0};
  sched_setscheduler(0, SCHED_OTHER, &parameter);
  munlockall();
}

Times BareTimer(double seconds) {
  const Clock clock;
  Times lateness;
  lateness.reserve(static_cast<size_t>(seconds * 1e6 / kPeriod) + 10);
  const int64_t end = clock.Now() + Microseconds(seconds);
  for (Periodic cycle(kPeriod, clock.Now()); clock.Now() < end;) {
    const timespec wait = clock.RealDuration(cycle.Remaining(clock.Now()));
    ppoll(nullptr, 0, &wait, nullptr);
    const int64_t now = clock.Now();
    if (cycle.Due(now)) lateness.push_back(cycle.Advance(now));
  }
  return lateness;
}

Times BarePingPong(double seconds, const std::string& lcm_url) {
  const pid_t echo = Fork([&] { Echo(lcm_url); });
  const Clock clock;
  Times times;
  times.reserve(static_cast<size_t>(seconds * 1e6 / kPeriod) + 10);
  {
    Messenger messenger(lcm_url);
    Publisher<joint_state_t> ping(messenger, "PING");
    Subscriber<joint_state_t> pong(messenger, "PONG");
    joint_state_t message = Message();
    const auto answered = [&] {
      return pong.received() > 0 && pong.newest().sequence == message.sequence;
    };
    const int64_t begin = clock.Now(), end = begin + Microseconds(seconds);
    for (Periodic cycle(kPeriod, begin); clock.Now() < end;) {
      const timespec wait = clock.RealDuration(cycle.Remaining(clock.Now()));
      ppoll(nullptr, 0, &wait, nullptr);
      if (!cycle.Due(clock.Now())) continue;
      cycle.Advance(clock.Now());
      ++message.sequence;
      const int64_t sent = clock.Now();
      ping.Publish(message);
      while (!answered() && clock.Now() - sent < kPatience) {
        pollfd polled{messenger.fd(), POLLIN, 0};
        poll(&polled, 1, 10);
        messenger.Drain();
      }
      // The first ones find nobody there yet.
      if (answered() || !times.empty()) times.push_back(clock.Now() - sent);
    }
  }
  End(echo);
  return times;
}

}  // namespace plumb
