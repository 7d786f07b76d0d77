#include "cli/training_progress.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <stdexcept>

#include "common/atomic_file.h"

namespace plumb {
namespace {

constexpr char kCsvHeader[] =
    "update,steps,mean_return,evaluation_return,kl,surrogate_gain,explained_variance,entropy,"
    "accepted,dropped_episodes,seconds\n";

std::string TimeLeft(double seconds) {
  const auto whole = static_cast<int64_t>(std::ceil(std::max(seconds, 0.)));
  return whole >= 3600 ? fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60)
                       : fmt::format("{}:{:02}", whole / 60, whole % 60);
}

}  // namespace

ProgressTable::ProgressTable(const std::string& file, int64_t updates) : file_(file) {
  if (file.empty()) return;
  std::string kept = kCsvHeader, line;
  if (updates > 0) {
    std::ifstream old(file);
    for (int64_t last = 0; last < updates && std::getline(old, line);) {
      last = std::atoll(line.c_str());
      if (last > 0) kept += line + "\n";
    }
  }
  WriteAtomically(file, kept);
  stream_.open(file, std::ios::app);
}

void ProgressTable::Add(const Trainer& trainer, const UpdateReport& report, double evaluation,
                        double seconds) {
  if (file_.empty()) return;
  stream_ << fmt::format("{},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:d},{},{:.3f}\n",
                         trainer.updates(), trainer.steps(), report.mean_return, evaluation,
                         report.step.kl, report.step.surrogate_gain, report.explained_variance,
                         report.entropy, report.step.accepted, report.dropped_episodes, seconds)
          << std::flush;
  if (!stream_) throw std::runtime_error(file_ + ": cannot be written: " + std::strerror(errno));
}

void TrainingProgress::Show(const Trainer& trainer, const UpdateReport& report, int64_t steps,
                            int64_t done_before) {
  if (!speaks_) return;
  const double seconds = clock_.seconds();
  if (seconds < next_ && trainer.steps() < steps) return;
  next_ = seconds + (line_.shown() ? 0.1 : 5);
  const double speed = static_cast<double>(trainer.steps() - done_before) / seconds;
  const std::string line = fmt::format(
      "{:3.0f} %  {:.3g} steps  return {:.5g}  KL {:.4f}  gain {:.3f}  explained {:.2f}  entropy "
      "{:.2f}  {:.3g} steps/s  {} left",
      100 * std::min(1., static_cast<double>(trainer.steps()) / static_cast<double>(steps)),
      static_cast<double>(trainer.steps()), report.mean_return, report.step.kl,
      report.step.surrogate_gain, report.explained_variance, report.entropy, speed,
      TimeLeft(static_cast<double>(steps - trainer.steps()) / speed));
  line_.Show(line);
  if (!line_.shown()) std::cerr << line << std::endl;
}

}  // namespace plumb
