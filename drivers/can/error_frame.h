#pragma once

#include "drivers/can/frame.h"

namespace plumb {

/// A controller's error frame to a driver (classes of linux/can/error.h). Thread-safe. A value.
enum class BusEvent {
  kNone,       ///< not an error frame, or one without consequence (lost arbitration, error-warning)
  kBusOff,     ///< the controller has left the bus; nothing is sent or received any more
  kRestarted,  ///< it is back
  kNoAck,      ///< a frame was sent and nobody acknowledged it
};

inline BusEvent DecodeErrorFrame(const Frame& frame) {
  constexpr uint32_t kClassNoAck = 0x20, kClassBusOff = 0x40, kClassRestarted = 0x100;
  if (!frame.error) return BusEvent::kNone;
  if (frame.id & kClassBusOff) return BusEvent::kBusOff;
  if (frame.id & kClassRestarted) return BusEvent::kRestarted;
  if (frame.id & kClassNoAck) return BusEvent::kNoAck;
  return BusEvent::kNone;
}

}  // namespace plumb
