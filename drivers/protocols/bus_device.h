#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "drivers/protocols/fields.h"

namespace plumb {

/// One kind of message that a device sends, or listens to and the driver sends. Plain data, as all
/// of this file: not thread-safe.
struct BusMessage {
  enum class Direction : uint8_t { kFromDevice, kToDevice };
  /// [us] assumed of what a program on Linux sends once per period.
  static constexpr int64_t kHostJitter = 200;

  Layout layout;             ///< name, fields, and bytes on the wire
  uint32_t id = 0;           ///< 11 bits, or 29 if extended
  uint32_t sender_bits = 0;  ///< of the id: other masters have other ones, and are obeyed, too
  bool extended = false;
  bool remote = false;  ///< a request: no data
  bool fd = false;      ///< a frame of CAN FD, its data at the faster rate
  Direction direction = Direction::kFromDevice;
  int64_t period = 0;  ///< [us]; 0 = now and then, not while the robot moves
  int64_t jitter = 0;  ///< [us] by which it may be queued late
  /// index into BusDevice::messages of the question that this one answers, whose response time adds
  /// to the jitter; -1 = it is no answer
  int answers = -1;
  /// The driver asks for it, and for one such message of the whole bus at a time; or it is that
  /// question.
  bool polled = false;
  /// Other devices of the protocol may have it, too: broadcasts, and replies that say whose they
  /// are.
  bool shared = false;
  /// Value of its first field, where that tells it from others of its id: whose it is if it is
  /// shared, else which of the device's messages; -1 = nothing has to
  int selector = -1;
};

/// Ids [first, last] that are a device's own, whatever of them it uses.
struct IdRange {
  uint32_t first, last;
};

/// A device's messages on a bus, and the ids that are its own.
struct BusDevice {
  std::string name;
  std::string protocol;
  std::vector<BusMessage> messages;
  std::vector<IdRange> claims;  ///< of standard ids
  /// Standard ids of what else it obeys: the driver sends none of it, and nobody else may.
  std::vector<uint32_t> obeys = {};
};

}  // namespace plumb
