#include "records/pacing.h"

#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>

namespace plumb {
namespace {

/// A listener with a buffer of the kernel's default size, as the kernel counts.
struct Buffer {
  static constexpr size_t kBuffer = 212'992;
  void Hear(size_t size) {
    const size_t cost = size + 768;
    if (waiting + cost > kBuffer)
      ++drops;
    else
      waiting += cost;
  }
  Listener queue(uint64_t socket, bool working = false) const {
    return {{socket, waiting, drops}, working};
  }
  size_t waiting = 0;
  uint64_t drops = 0;
};

TEST_CASE("as long as a listener takes nothing, no more is sent than its buffer holds") {
  const size_t size = GENERATE(0u, 100u, 1400u, 30'000u);
  Buffer listener;
  Pacing pacing([&] { return std::vector{listener.queue(1)}; });
  int sent = 0;
  for (; sent < 1000 && pacing.MaySend(size); ++sent) listener.Hear(size);
  CHECK(sent > 0);
  CHECK(sent < 1000);
  CHECK_FALSE(pacing.MaySend(size));
  listener.waiting /= 2;  // it takes some
  for (; sent < 2000 && pacing.MaySend(size); ++sent) listener.Hear(size);
  listener.waiting = 0;
  CHECK(pacing.MaySend(size));
  CHECK(pacing.Lost() == 0);
}

TEST_CASE("the slowest listener counts, and a message larger than all room goes alone") {
  Buffer fast, slow;
  Pacing pacing([&] { return std::vector{fast.queue(1), slow.queue(2)}; });
  CHECK(pacing.MaySend(1 << 20));
  slow.waiting = 1;
  CHECK_FALSE(pacing.MaySend(1 << 20));
  slow.waiting = 0;
  CHECK(pacing.MaySend(1 << 20));
}

TEST_CASE("a listener that stands still is not waited for until it goes on") {
  Buffer listener;
  Pacing pacing([&] { return std::vector{listener.queue(1)}; });
  while (pacing.MaySend(100)) listener.Hear(100);
  int naps = 0;
  for (; naps < 2 * Pacing::kPatience && !pacing.MaySend(100); ++naps) continue;
  CHECK(naps == Pacing::kPatience - 1);
  CHECK(pacing.standing_still() == 1);
  for (int i = 0; i < 1000; ++i) {
    REQUIRE(pacing.MaySend(100));
    listener.Hear(100);
  }
  CHECK(pacing.Lost() == listener.drops);
  CHECK(pacing.Lost() > 0);
  listener.waiting -= 768;
  CHECK(pacing.Lost() == listener.drops);
  CHECK(pacing.standing_still() == 0);
  CHECK_FALSE(pacing.MaySend(100));
}

TEST_CASE("what was lost before, and by others' sockets later, is not ours") {
  Buffer listener;
  listener.drops = 7;
  std::vector<Listener> queues{listener.queue(1)};
  Pacing pacing([&] { return queues; });
  queues.push_back({{2, 0, 100}});
  CHECK(pacing.Lost() == 0);
  queues[0].queue.drops += 2;
  queues[1].queue.drops += 3;
  CHECK(pacing.Lost() == 5);
  queues.clear();
  CHECK(pacing.Lost() == 5);
}

TEST_CASE("who keeps thirty messages is not given more before he has dealt with them") {
  bool working = false;
  Pacing pacing([&] { return std::vector{Buffer().queue(1, working)}; });
  for (int i = 0; i < 1000; ++i) REQUIRE(pacing.MaySend(10));
  working = true;
  int sent = 0;
  while (pacing.MaySend(10)) ++sent;
  CHECK(sent < 30);
  CHECK_FALSE(pacing.MaySend(10));
  working = false;
  CHECK(pacing.MaySend(10));
  // Nor is one waited for who works all the time.
  working = true;
  sent = 0;
  for (int naps = 0; naps < 10 * Pacing::kWorkPatience; ++naps) sent += pacing.MaySend(10) ? 1 : 0;
  CHECK(sent > 100);
}

TEST_CASE("a process rests when none of its threads runs, and is found by its socket") {
  const int fd = socket(AF_INET, SOCK_DGRAM, 0);
  const pid_t sleeper = fork();
  if (sleeper == 0) {
    close(fd);
    for (;;) pause();
  }
  const pid_t worker = fork();
  if (worker == 0) {
    close(fd);
    for (volatile unsigned i = 0;;) i = i + 1;
  }
  for (int i = 0; i < 100'000 && !Rests(sleeper); ++i) usleep(100);
  CHECK(Rests(sleeper));
  CHECK_FALSE(Rests(worker));
  for (const pid_t child : {sleeper, worker}) {
    kill(child, SIGKILL);
    CHECK(waitpid(child, nullptr, 0) == child);
    CHECK(Rests(child));
  }
  struct stat status {};
  REQUIRE(fstat(fd, &status) == 0);
  CHECK(FindOwner(status.st_ino) == getpid());
  close(fd);
  CHECK(FindOwner(status.st_ino) == 0);
}

}  // namespace
}  // namespace plumb
