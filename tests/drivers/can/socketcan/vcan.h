#pragma once

#include <poll.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <string>
#include <vector>

#include "drivers/can/transport.h"

namespace plumb {

using Texts = std::vector<std::string>;

inline bool InGuest() {
  const char* backend = std::getenv("WITH_VCAN");
  return backend != nullptr && std::string(backend) == "uml";
}

inline void RequireVcan() {
  const char* backend = std::getenv("WITH_VCAN");
  if (backend == nullptr) FAIL("run by tests/with-vcan");
  // There vcan0 is the machine's own and not ours to remove: CTest counts this as skipped.
  if (std::string(backend) == "native") std::exit(77);
}

inline void Shell(const std::string& command) {
  INFO(command);
  REQUIRE(std::system(command.c_str()) == 0);
}

/// For what a machine's own kernel need not have. @return true if the command worked; in the guest
/// it must.
inline bool Try(const std::string& command) {
  RequireVcan();
  if (InGuest()) Shell(command);
  if (InGuest() || std::system(command.c_str()) == 0) return true;
  WARN("not tested: this kernel cannot " + command);
  return false;
}

/// vcan0, new and up, whatever the case before did with it.
inline void FreshVcan() {
  RequireVcan();
  Shell("ip link del vcan0 2>/dev/null; ip link add dev vcan0 type vcan && ip link set vcan0 up");
}

/// Long enough for any machine: only who fails waits so long.
constexpr int kPatience = 10'000;  // [ms]

inline bool Readable(const Transport& transport, int milliseconds = kPatience) {
  pollfd polled{transport.fd(), POLLIN, 0};
  return poll(&polled, 1, milliseconds) == 1;
}

/// The frames that are to arrive, however long it takes, and what else comes within a moment.
inline Texts ReceiveAll(Transport& transport, size_t expected = 0) {
  Texts texts;
  std::array<Frame, 8> frames;
  for (int wakes = 0;; ++wakes) {
    REQUIRE(wakes < 10'000);  // awake for nothing
    const int count = transport.Receive(frames);
    for (int i = 0; i < count; ++i) texts.push_back(ToText(frames[static_cast<size_t>(i)]));
    if (count == 0 && !Readable(transport, texts.size() < expected ? kPatience : 50)) return texts;
  }
}

/// Whether just these frames arrive, and in this order.
inline void CheckReceives(Transport& transport, const Texts& texts) {
  CHECK(ReceiveAll(transport, texts.size()) == texts);
}

/// Whether what came is nothing but the echoes of what it has sent.
inline void CheckEchoes(Transport& transport, int64_t expected) {
  std::array<Frame, 8> none;
  for (int wakes = 0; transport.stats().echoes < expected && Readable(transport); ++wakes) {
    REQUIRE(wakes < 10'000);  // awake for nothing
    REQUIRE(transport.Receive(none) == 0);
  }
  CHECK(ReceiveAll(transport).empty());
  CHECK(transport.stats().echoes == expected);
}

inline int Send(Transport& transport, const Texts& texts) {
  std::vector<Frame> frames;
  for (const std::string& text : texts) frames.push_back(*FrameFromText(text));
  return transport.Send(frames);
}

}  // namespace plumb
