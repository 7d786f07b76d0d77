#include "drivers/can/lockstep_transport.h"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <deque>
#include <string_view>
#include <utility>

#include "common/lockstep/participant.h"

namespace plumb {
namespace {

constexpr int kGlance = 100;  // [ms] of real time between two looks for a frame on its way
// [us] by which a frame may be on the bus before the run says that it arrives
constexpr int64_t kEarly = 100'000;
constexpr int64_t kLook = 10'000;  // [us] between two looks at what nobody waits for

class LockstepTransport : public Transport {
 public:
  LockstepTransport(const std::string& url, std::unique_ptr<Transport> bus,
                    std::vector<Filter> filters, LockstepBus run)
      : Transport(std::move(filters)),
        topic_(BusTopic(url)),
        bus_(std::move(bus)),
        run_(*run.participant),
        way_(run.way),
        patience_(run.patience),
        heard_(run_.frames(url)) {
    run_.Listen(topic_);
    if (!bus_) return;
    link_ = bus_->link();
    warnings_ = bus_->warnings();
  }

  int fd() const noexcept override { return bus_ ? bus_->fd() : -1; }
  bool carries_fd() const noexcept override { return !bus_ || bus_->carries_fd(); }

  int Send(std::span<const Frame> frames) noexcept override {
    if (bus_) bus_->SetTime(run_.now());
    const int accepted = bus_ ? bus_->Send(frames) : static_cast<int>(frames.size());
    for (const Frame& frame : frames.first(static_cast<size_t>(std::max(accepted, 0)))) {
      const std::string text = ToText(frame);
      run_.Say(topic_, {text.begin(), text.end()}, way_);
    }
    stats_.sent += accepted;
    stats_.refused += static_cast<int64_t>(frames.size()) - accepted;
    if (bus_) link_ = bus_->link();
    return accepted;
  }

  int Receive(std::span<Frame> frames) noexcept override {
    size_t count = 0;
    for (; count < frames.size() && !heard_.empty(); heard_.pop_front()) {
      const lockstep_post_t& post = heard_.front();
      const auto frame =
          FrameFromText({reinterpret_cast<const char*>(post.data.data()), post.data.size()});
      if (!frame || !Passes(*frame) || !Arrives(*frame)) continue;
      Frame& out = frames[count++] = *frame;
      out.receive_ns = post.arrival * 1000;
      out.foreign = IsOurs(out);
      if (out.foreign) ++stats_.foreign;
    }
    stats_.received += static_cast<int64_t>(count);
    if (bus_ && run_.now() >= next_look_) {
      next_look_ = run_.now() + kLook;
      ReadBus();
      NoteStrangers();
    }
    if (bus_) link_ = bus_->link();
    return static_cast<int>(count);
  }

  LinkState Reopen() noexcept override { return link_ = bus_ ? bus_->Reopen() : LinkState::kUp; }

 private:
  struct Early {
    Frame frame;
    int64_t read;  // run's time
  };

  /// Frames that have come by the bus and have not been handed out yet.
  void ReadBus() noexcept {
    for (size_t count = batch_.size(); count == batch_.size();) {
      count = static_cast<size_t>(bus_->Receive(batch_));
      for (const Frame& frame : std::span(batch_).first(count)) {
        // The bus controller's own reports come from no participant.
        if (!frame.error) early_.push_back({frame, run_.now()});
      }
    }
  }

  /// Waits for a frame that has been sent. @return whether it is here.
  bool Arrives(const Frame& frame) noexcept {
    if (!bus_) return true;
    ++expected_;
    for (int glance = 0; glance <= patience_; ++glance) {
      const auto found = std::ranges::find_if(
          early_, [&](const Early& early) { return SameOnWire(early.frame, frame); });
      if (found != early_.end()) {
        early_.erase(found);
        return true;
      }
      // A link that has gone down may have taken the frame with it.
      if (bus_->link() != LinkState::kUp) return false;
      pollfd readable{bus_->fd(), POLLIN, 0};
      if (glance > 0) poll(&readable, 1, kGlance);
      ReadBus();
    }
    run_.Fail(fmt::format("lost on {}: {}, frame {} for this process", topic_.name, ToText(frame),
                          expected_));
    return false;
  }

  void NoteStrangers() noexcept {
    while (!early_.empty() && run_.now() - early_.front().read > kEarly) {
      if (!noted_) {
        run_.Note(fmt::format(
            "{} on {} is from outside the run, and ignored: --real-time hears everybody",
            ToText(early_.front().frame), topic_.name));
      }
      noted_ = true;
      early_.pop_front();
    }
  }

  const lockstep_topic_t topic_;
  const std::unique_ptr<Transport> bus_;
  Participant& run_;
  const int64_t way_;
  const int patience_;
  std::deque<lockstep_post_t>& heard_;
  std::array<Frame, 64> batch_;
  std::deque<Early> early_;
  int64_t expected_ = 0;
  int64_t next_look_ = 0;
  bool noted_ = false;
};

}  // namespace

std::unique_ptr<Transport> OpenLockstep(const std::string& url, std::unique_ptr<Transport> bus,
                                        std::vector<Filter> filters, LockstepBus run) {
  return std::make_unique<LockstepTransport>(url, std::move(bus), std::move(filters), run);
}

}  // namespace plumb
