#include "drivers/can/faulty.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <utility>

#include "common/random.h"
#include "drivers/can/fault_lane.h"

namespace plumb {
namespace {

constexpr int64_t kBusOff = 100'000;  // [us]; the usual restart-ms of can0
enum Stream : uint32_t { kReceiving, kSending, kReceiveMishaps, kSendMishaps };

Frame ErrorFrame(uint32_t error_class, uint8_t controller = 0, uint8_t violation = 0) {
  Frame frame;
  frame.error = true;
  frame.id = error_class;
  frame.length = 8;
  frame.data[1] = controller;
  frame.data[2] = violation;
  return frame;
}

class Faulty : public Transport {
 public:
  Faulty(const Faults& faults, std::unique_ptr<Transport> bus)
      : Transport({}),
        faults_(faults),
        bus_(std::move(bus)),
        receiving_(faults.receive, faults.seed, kReceiving),
        sending_(faults.send, faults.seed, kSending),
        receive_mishaps_(faults.seed, {kReceiveMishaps}),
        send_mishaps_(faults.seed, {kSendMishaps}) {
    warnings_ = bus_->warnings();
    NoteBus();
  }

  int fd() const noexcept override { return bus_->fd(); }
  bool is_replay() const noexcept override { return bus_->is_replay(); }
  bool carries_fd() const noexcept override { return bus_->carries_fd(); }

  void SetTime(int64_t now) noexcept override {
    now_ = std::max(now_, now);
    bus_->SetTime(now_);
    if (bus_off_ && now_ >= bus_back_) {
      bus_off_ = false;
      receiving_.Append(ErrorFrame(0x100), now_);
    }
    stats_.refused += PassOn();
    NoteBus();
  }

  int64_t NextEvent() const noexcept override {
    return std::min(
        {bus_->NextEvent(), receiving_.next(), sending_.next(), bus_off_ ? bus_back_ : kNever});
  }

  int Send(std::span<const Frame> frames) noexcept override {
    size_t accepted = 0;
    for (; accepted < frames.size() && !bus_off_ && sending_.room() > 0; ++accepted) {
      if (send_mishaps_.Uniform() < faults_.full) {
        ++mishaps_;
        break;
      }
      sending_.Add(frames[accepted], now_);
      if (PassOn() > 0) break;
    }
    stats_.sent += static_cast<int64_t>(accepted);
    stats_.refused += static_cast<int64_t>(frames.size() - accepted);
    NoteBus();
    return static_cast<int>(accepted);
  }

  int Receive(std::span<Frame> frames) noexcept override {
    const size_t room = std::min({frames.size(), scratch_.size(), receiving_.room() / 2});
    const int got = bus_->Receive(std::span(scratch_).first(room));
    for (int i = 0; i < got; ++i) Meet(scratch_[static_cast<size_t>(i)]);
    int count = 0;
    while (static_cast<size_t>(count) < frames.size()) {
      const Frame* frame = receiving_.Arrived(now_);
      if (frame == nullptr) break;
      frames[static_cast<size_t>(count++)] = *frame;
      receiving_.Pop();
    }
    stats_.received += count;
    NoteBus();
    return count;
  }

  LinkState Reopen() noexcept override {
    bus_->Reopen();
    NoteBus();
    return link_;
  }

 private:
  /// A frame comes in from the bus.
  void Meet(const Frame& frame) noexcept {
    const bool error = receive_mishaps_.Uniform() < faults_.errors;
    const bool off = receive_mishaps_.Uniform() < faults_.busoff;
    const uint32_t which = receive_mishaps_.Bits() % 4;
    if (bus_off_) return;
    if (off) {
      ++mishaps_;
      bus_off_ = true;
      bus_back_ = now_ + kBusOff;
      receiving_.Append(ErrorFrame(0x40), now_);
      return;
    }
    if (error) {
      ++mishaps_;
      const std::array<Frame, 4> errors = {ErrorFrame(0x20), ErrorFrame(0x04, 0x08),
                                           ErrorFrame(0x04, 0x20), ErrorFrame(0x08, 0, 0x04)};
      receiving_.Append(errors[which], now_);
    }
    receiving_.Add(frame, now_);
  }

  /// Sends what has got through. @return how many frames the bus refused.
  int64_t PassOn() noexcept {
    int64_t refused = 0;
    while (const Frame* frame = sending_.Arrived(now_)) {
      if (bus_off_ || bus_->Send({frame, 1}) != 1) ++refused;
      sending_.Pop();
    }
    return refused;
  }

  void NoteBus() noexcept {
    link_ = bus_->link();
    const TransportStats& theirs = bus_->stats();
    stats_.malformed = theirs.malformed;
    stats_.lost = theirs.lost;
    stats_.echoes = theirs.echoes;
    stats_.foreign = theirs.foreign;
    stats_.injected = theirs.injected + receiving_.injected() + sending_.injected() + mishaps_;
  }

  const Faults faults_;
  const std::unique_ptr<Transport> bus_;
  FaultLane receiving_, sending_;
  Random receive_mishaps_, send_mishaps_;
  std::array<Frame, 64> scratch_;
  int64_t now_ = 0;
  bool bus_off_ = false;
  int64_t bus_back_ = 0;
  int64_t mishaps_ = 0;
};

}  // namespace

std::unique_ptr<Transport> OpenFaulty(const std::string& faults_and_bus,
                                      std::vector<Filter> filters, LockstepBus run) {
  const size_t colon = faults_and_bus.find(':');
  if (colon == std::string::npos) {
    throw std::runtime_error(fmt::format(
        "faulty:{}: faults and a bus are wanted, such as faulty:loss=0.1:udp:239.74.163.2:43113",
        faults_and_bus));
  }
  try {
    const Faults faults = ParseFaults(faults_and_bus.substr(0, colon));
    return std::make_unique<Faulty>(
        faults, OpenTransport(faults_and_bus.substr(colon + 1), std::move(filters), run));
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(fmt::format("faulty: {}", error.what()));
  }
}

}  // namespace plumb
