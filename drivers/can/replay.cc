#include "drivers/can/replay.h"

#include <fmt/format.h>
#include <sys/eventfd.h>

#include <algorithm>
#include <fstream>
#include <set>
#include <stdexcept>

#include "common/file_descriptor.h"
#include "drivers/can/candump.h"

namespace plumb {
namespace {

constexpr size_t kMaxNamed = 5;        // malformed lines
constexpr size_t kMaxCharacters = 60;  // of such a line

class Replay : public Transport {
 public:
  Replay(const std::string& file, std::vector<Filter> filters)
      : Transport(std::move(filters)), readable_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
    if (!readable_.valid())
      throw std::runtime_error(fmt::format("replay:{}: too many open files", file));
    Read(file);
    if (frames_.empty() && stats_.echoes == 0 && unwanted_ == 0) {
      throw std::runtime_error(
          fmt::format("replay:{}: no line of it is a frame; record with candump -l can0, or "
                      "can_logger -f run.log",
                      file));
    }
    Signal();
  }

  int fd() const noexcept override { return readable_.get(); }
  bool is_replay() const noexcept override { return true; }

  void SetTime(int64_t now) noexcept override {
    if (start_ == kNever) start_ = now;
    now_ = std::max(now_, now);
    Signal();
  }

  int64_t NextEvent() const noexcept override {
    if (next_ == frames_.size()) return kNever;
    return start_ == kNever ? std::numeric_limits<int64_t>::min() : start_ + frames_[next_].after;
  }

  int Send(std::span<const Frame> frames) noexcept override {
    stats_.sent += static_cast<int64_t>(frames.size());
    return static_cast<int>(frames.size());
  }

  int Receive(std::span<Frame> frames) noexcept override {
    size_t count = 0;
    for (; count < frames.size() && NextEvent() <= now_; ++count)
      frames[count] = frames_[next_++].frame;
    stats_.received += static_cast<int64_t>(count);
    Signal();
    return static_cast<int>(count);
  }

 private:
  struct Entry {
    int64_t after;  // the first frame of the log [us]
    Frame frame;
  };

  void Read(const std::string& file) {
    std::ifstream stream(file);
    if (!stream) throw std::runtime_error(fmt::format("replay:{}: cannot be read", file));
    std::set<std::string, std::less<>> interfaces;
    int64_t first_ns = -1, after = 0, number = 0;
    for (std::string line; std::getline(stream, line);) {
      ++number;
      if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
      const auto logged = ParseCandump(line);
      if (!logged) {
        if (++stats_.malformed <= static_cast<int64_t>(kMaxNamed)) {
          warnings_.push_back(fmt::format("{}:{}: not a line of candump -l: '{}'{}", file, number,
                                          line.substr(0, kMaxCharacters),
                                          line.size() > kMaxCharacters ? "..." : ""));
        }
        continue;
      }
      if (!interfaces.contains(logged->interface)) interfaces.emplace(logged->interface);
      if (first_ns < 0) first_ns = logged->time_ns;
      after = std::max(after, (logged->time_ns - first_ns) / 1000);
      if (IsOurs(logged->frame)) {
        ++stats_.echoes;
      } else if (Passes(logged->frame)) {
        frames_.push_back({after, logged->frame});
      } else {
        ++unwanted_;
      }
    }
    if (stats_.malformed > static_cast<int64_t>(kMaxNamed)) {
      warnings_.push_back(
          fmt::format("{}: {} lines in all are not of candump -l", file, stats_.malformed));
    }
    if (interfaces.size() > 1) {
      warnings_.push_back(
          fmt::format("{}: frames of {} interfaces are replayed as of one; cure: grep ' {} '", file,
                      interfaces.size(), *interfaces.begin()));
    }
  }

  /// Makes fd() readable when a frame is due, and only then.
  void Signal() noexcept {
    const bool due = Replay::NextEvent() <= now_;
    if (due == signalled_) return;
    signalled_ = due;
    eventfd_t count = 1;
    due ? eventfd_write(readable_.get(), count) : eventfd_read(readable_.get(), &count);
  }

  FileDescriptor readable_;
  bool signalled_ = false;
  std::vector<Entry> frames_;
  size_t next_ = 0;
  int64_t unwanted_ = 0;
  int64_t start_ = kNever;                             // the first SetTime
  int64_t now_ = std::numeric_limits<int64_t>::min();  // the latest
};

}  // namespace

std::unique_ptr<Transport> OpenReplay(const std::string& file, std::vector<Filter> filters) {
  return std::make_unique<Replay>(file, std::move(filters));
}

}  // namespace plumb
