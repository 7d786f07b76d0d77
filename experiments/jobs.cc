#include "experiments/jobs.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <iostream>
#include <span>

#include "common/progress_line.h"
#include "common/time_units.h"

namespace plumb {
namespace {

struct Stopped {};

std::string Duration(double seconds) {
  const auto whole = std::lround(seconds);
  return whole < 60 ? fmt::format("{} s", whole)
                    : fmt::format("{}:{:02} min", whole / 60, whole % 60);
}

/// What a rank has of a round: its job's rows; none, of one that had no job; or it was stopped.
using Part = std::optional<Results::Rows>;

// Of all ranks, in their order. On the way a part is its number of rows, -1 if it was stopped, and
// their values.
std::vector<Part> Gather(const Results& results, const Part& mine) {
  std::vector<double> numbers{mine ? static_cast<double>(mine->size()) : -1};
  for (const std::vector<double>& row : mine.value_or(Results::Rows()))
    numbers.insert(numbers.end(), row.begin(), row.end());
  const std::vector<std::byte> bytes =
      results.ranks().Concatenate(std::as_bytes(std::span(numbers)));
  numbers.resize(bytes.size() / sizeof(double));
  std::memcpy(numbers.data(), bytes.data(), bytes.size());

  std::vector<Part> parts;
  for (auto next = numbers.begin(); next != numbers.end();) {
    const double rows = *next++;
    Part& part = parts.emplace_back();
    if (rows < 0) continue;
    part.emplace();
    for (int row = 0; row < rows; ++row) {
      part->emplace_back(next, next + static_cast<ptrdiff_t>(results.values()));
      next += static_cast<ptrdiff_t>(results.values());
    }
  }
  return parts;
}

class Progress {
 public:
  explicit Progress(bool speaks) : speaks_(speaks), line_(speaks) {}

  /// @param share of all the work that is done, 0 to 1.
  void Show(const std::string& what, double of_job, double share) {
    if (!line_.shown()) return;
    const std::string rest = share > 0 ? Left(share) + " left" : "";
    line_.Show(fmt::format("{}  {:.0f} %  {}", what, 100 * of_job, rest));
  }
  void Done(const std::string& what, double share) const {
    if (speaks_ && !line_.shown())
      std::cerr << fmt::format("{} done, {} left\n", what, Left(share));
  }
  void BreakOff() {
    line_.Clear();
    if (speaks_) std::cerr << "stopped; the same command goes on from here\n";
  }

 private:
  std::string Left(double share) const {
    return Duration(SecondsSince(start_) * (1 - share) / share);
  }

  const bool speaks_;
  ProgressLine line_;
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace

std::optional<int> RunJobs(Process& process, const std::vector<Job>& jobs, Results& results) {
  std::vector<size_t> pending;
  double all = 0, done = 0;
  for (size_t i = 0; i < jobs.size(); ++i) {
    if (results.Has(jobs[i].key)) continue;
    pending.push_back(i);
    all += jobs[i].weight;
  }
  const auto size = static_cast<size_t>(results.ranks().size());
  const auto rank = static_cast<size_t>(results.ranks().rank());
  Progress progress(rank == 0);
  const auto name = [&](size_t i) {
    return fmt::format("{} of {}: {}", i + 1, jobs.size(), jobs[i].key);
  };
  for (size_t first = 0; first < pending.size(); first += size) {
    const std::span<const size_t> round =
        std::span(pending).subspan(first, std::min(size, pending.size() - first));
    double weight = 0;
    for (const size_t i : round) weight += jobs[i].weight;
    Part mine = Results::Rows();
    if (rank < round.size()) {
      const auto advance = [&](double share) {
        if (process.stopping()) throw Stopped();
        progress.Show(name(round[rank]), share, (done + share * weight) / all);
      };
      try {
        advance(0);
        mine = jobs[round[rank]].run(advance);
      } catch (const Stopped&) {
        mine.reset();
      }
    }
    const std::vector<Part> parts = Gather(results, mine);
    for (size_t r = 0; r < round.size(); ++r) {
      if (!parts[r]) continue;
      results.Add(jobs[round[r]].key, *parts[r]);
      done += jobs[round[r]].weight;
      progress.Done(name(round[r]), done / all);
    }
    if (!std::ranges::all_of(parts, &Part::has_value)) {
      progress.BreakOff();
      return 130;
    }
  }
  if (rank > 0) return 0;
  return {};
}

}  // namespace plumb
