#pragma once

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <string>

#include "drivers/can/transport.h"
#include "tests/drivers/driver/rig.h"

namespace plumb {

/// A rig with two drives whose frames go over a loop bus: the driver's end can be made faulty or
/// cut off, strangers can join, and a witness notes when torque was last asked for by the driver
/// and last produced by a drive.
struct BusRig : Rig {
  static constexpr char kBus[] = "loop:bus_rig";
  static bool Nothing(const Frame&) { return false; }

  BusRig() : Rig(2), stranger(OpenTransport(kBus)), drives_end_(OpenTransport(kBus)) {
    on_step = [this] {
      for (const CanSimpleDevice& drive : drives) {
        if (drive.Torque() != 0) torque_produced = now;
      }
      for (const auto& event : each_millisecond) event();
      for (Transport* end : {drivers_end_.get(), drives_end_.get(), stranger.get()})
        end->SetTime(now);
      DeliverToDrives();
      DeliverToDriver();
    };
    to_driver = [this](Frame& frame) {
      if (silent(frame)) return false;
      drives_end_->Send({&frame, 1});
      DeliverToDriver();
      return false;
    };
    accept = [this](const std::vector<Frame>& frames) {
      const int accepted = cut_off ? 0 : drivers_end_->Send(frames);
      for (int i = 0; i < accepted; ++i) Witness(frames[static_cast<size_t>(i)]);
      DeliverToDrives();
      return accepted;
    };
    to_drive = [](Frame&) { return false; };  // delivered by now
  }

  void Start() {
    Rig::Start();
    Connect("");
  }
  /// From now on the driver has the bus with these faults (see faulty.h); "": with none.
  void Connect(const std::string& faults) {
    const std::string url = faults.empty() ? kBus : fmt::format("faulty:{}:{}", faults, kBus);
    drivers_end_ = OpenTransport(url, driver->filters(0));
    drivers_end_->SetTime(now);
  }
  /// The driver's process stands still.
  void StopDriver(int64_t milliseconds) {
    driver_stopped = true;
    Run(milliseconds);
    driver_stopped = false;
  }
  /// Somebody else sends a frame.
  void StrangerSends(const std::string& text) {
    const Frame frame = FrameFromText(text).value();
    stranger->Send({&frame, 1});
  }
  /// The driver's own controller says something: an error frame, which is on nobody's bus.
  void ControllerSays(const std::string& text) {
    driver->OnFrame(0, FrameFromText(text).value(), now, utime());
  }
  const driver_status_t& Status() {
    stats = drivers_end_->stats();
    return Rig::Status();
  }

  std::function<bool(const Frame&)> silent = Nothing,
                                    deaf = Nothing;  ///< frames the drives do not send or hear
  std::vector<std::function<void()>> each_millisecond;
  std::unique_ptr<Transport> stranger;
  bool cut_off = false;  ///< nothing goes to or comes from the driver
  LinkState link = LinkState::kUp;
  int64_t torque_asked_for = 0;  ///< `now` of the driver's last torque frame that was not zero
  int64_t torque_produced = 0;   ///< `now` when a drive last had a torque

 private:
  static constexpr int kBursts =
      8;  // of frames in a millisecond: more than there are wait, as with the real process

  void DeliverToDriver() {
    if (driver_stopped) return;
    std::array<Frame, 64> frames;
    for (int burst = 0; burst < kBursts && !cut_off; ++burst) {
      const int count = drivers_end_->Receive(frames);
      for (int i = 0; i < count; ++i)
        driver->OnFrame(0, frames[static_cast<size_t>(i)], now, utime());
      if (count <= 0) break;
    }
    driver->OnLink(0, link);
  }

  void DeliverToDrives() {
    std::array<Frame, 64> frames;
    for (int count; (count = drives_end_->Receive(frames)) > 0;) {
      for (int i = 0; i < count; ++i) {
        const Frame& frame = frames[static_cast<size_t>(i)];
        if (deaf(frame)) continue;
        for (CanSimpleDevice& drive : drives) drive.OnFrame(frame, now);
      }
    }
  }

  // Independent of the driver's own tables: Set_Input_Torque of nodes 1 and 2.
  void Witness(const Frame& frame) {
    if (frame.id != 0x02E && frame.id != 0x04E) return;
    float torque;
    std::memcpy(&torque, frame.data.data(), 4);
    if (torque != 0) torque_asked_for = now;
  }

  std::unique_ptr<Transport> drives_end_, drivers_end_;
};

}  // namespace plumb
