#include "drivers/driver/flight_recorder.h"

#include <fmt/format.h>
#include <signal.h>

#include <algorithm>
#include <exception>

#include "common/atomic_file.h"
#include "common/realtime.h"

namespace plumb {

FlightRecorder::FlightRecorder(const std::filesystem::path& folder, const BusDescription& bus,
                               size_t frames, Report report)
    : folder_(folder), name_(bus.name), bus_(bus.url), report_(std::move(report)) {
  if (folder_.empty()) return;
  MakeFolder(folder_);
  std::replace(bus_.begin(), bus_.end(), ' ', '_');
  for (Tape& tape : tapes_) tape.entries.resize(std::max<size_t>(frames, 1));
  writer_ = std::thread([this] { Serve(); });
}

FlightRecorder::~FlightRecorder() {
  if (!writer_.joinable()) return;
  for (int task = task_; task != kNone; task = task_) task_.wait(task);
  task_ = kStop;
  task_.notify_all();
  writer_.join();
}

void FlightRecorder::Record(const Frame& frame, bool sent, int64_t utime) noexcept {
  Tape& tape = tapes_[recording_];
  if (tape.entries.empty()) return;
  tape.entries[tape.next] = {frame, utime, sent};
  tape.next = tape.next + 1 < tape.entries.size() ? tape.next + 1 : 0;
  tape.count = std::min(tape.count + 1, tape.entries.size());
}

bool FlightRecorder::Dump(int64_t since, int64_t utime, std::string_view reason) noexcept {
  if (!writer_.joinable() || task_.load(std::memory_order_acquire) != kNone) return false;
  since_ = since, utime_ = utime;
  reason_.Set("{}", reason);
  recording_ = 1 - recording_;
  tapes_[recording_].next = tapes_[recording_].count = 0;
  task_.store(kWrite, std::memory_order_release);
  task_.notify_one();  // a system call that does not wait
  return true;
}

void FlightRecorder::Serve() {
  BecomeOrdinary();  // the cycle's priority is not for writing files
  // Signals are the main thread's business.
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
  for (;;) {
    task_.wait(kNone);
    if (task_ == kStop) return;
    Write(tapes_[1 - recording_]);
    task_.store(kNone, std::memory_order_release);
    task_.notify_all();
  }
}

void FlightRecorder::Write(const Tape& tape) const {
  try {
    const std::filesystem::path file =
        folder_ / fmt::format("fault_{}{}{}.log", utime_, name_.empty() ? "" : "_", name_);
    std::string text = fmt::format("# {}\n", reason_.text());
    for (size_t i = 0; i < tape.count; ++i) {
      const Entry& entry =
          tape.entries[(tape.next + tape.entries.size() - tape.count + i) % tape.entries.size()];
      if (entry.utime < since_) continue;
      text += fmt::format("({}.{:06}) {} {} {}\n", entry.utime / 1'000'000, entry.utime % 1'000'000,
                          bus_, ToText(entry.frame), entry.sent ? 'T' : 'R');
    }
    WriteAtomically(file, text);
    if (report_) report_(file.string(), {});
  } catch (const std::exception& error) {
    if (report_) report_({}, error.what());
  }
}

}  // namespace plumb
