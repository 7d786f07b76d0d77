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

// What each rank does, one after the other: whole groups, or every n-th job where there are fewer
// groups than ranks.
std::vector<std::vector<size_t>> Share(const std::vector<Job>& jobs,
                                       const std::vector<size_t>& pending, size_t ranks) {
  std::vector<int> groups;
  for (const size_t i : pending) {
    if (std::ranges::find(groups, jobs[i].group) == groups.end()) groups.push_back(jobs[i].group);
  }
  std::vector<std::vector<size_t>> queues(ranks);
  for (size_t k = 0; k < pending.size(); ++k) {
    const auto group =
        static_cast<size_t>(std::ranges::find(groups, jobs[pending[k]].group) - groups.begin());
    queues[(groups.size() < ranks ? k : group) % ranks].push_back(pending[k]);
  }
  return queues;
}

}  // namespace

std::optional<int> RunJobs(Process& process, const std::vector<Job>& jobs, Results& results) {
  std::vector<std::string> keys;
  keys.reserve(jobs.size());
  for (const Job& job : jobs) keys.push_back(job.key);
  results.Arrange(keys);
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
  const std::vector<std::vector<size_t>> queues = Share(jobs, pending, size);
  for (size_t k = 0; std::ranges::any_of(queues, [&](const auto& q) { return q.size() > k; });
       ++k) {
    const auto has = [&](size_t r) { return k < queues[r].size(); };
    double weight = 0;
    for (size_t r = 0; r < size; ++r) weight += has(r) ? jobs[queues[r][k]].weight : 0;
    Part mine = Results::Rows();
    if (has(rank)) {
      const size_t job = queues[rank][k];
      const auto advance = [&](double share) {
        if (process.stopping()) throw Stopped();
        progress.Show(name(job), share, (done + share * weight) / all);
      };
      try {
        advance(0);
        mine = jobs[job].run(advance);
      } catch (const Stopped&) {
        mine.reset();
      }
    }
    const std::vector<Part> parts = Gather(results, mine);
    for (size_t r = 0; r < size; ++r) {
      if (!has(r) || !parts[r]) continue;
      const size_t job = queues[r][k];
      results.Add(jobs[job].key, *parts[r]);
      done += jobs[job].weight;
      progress.Done(name(job), done / all);
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
