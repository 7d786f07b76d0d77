#include "experiments/results.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <stdexcept>

#include "common/atomic_file.h"
#include "common/progress_line.h"

namespace plumb {
namespace {

struct Stopped {};

std::string Duration(double seconds) {
  const auto whole = static_cast<int>(seconds + 0.5);
  return whole < 60 ? fmt::format("{} s", whole)
                    : fmt::format("{}:{:02} min", whole / 60, whole % 60);
}

}  // namespace

Results::Results(std::filesystem::path file, const std::string& settings,
                 std::vector<std::string> keys, std::vector<std::string> values)
    : file_(std::move(file)),
      lock_("results " + std::filesystem::weakly_canonical(file_).string(),
            file_.string() + ": another process is at work on it: give another --output") {
  const std::string columns = fmt::format("{},{}", fmt::join(keys, ","), fmt::join(values, ","));
  header_ = "# " + settings + "\n" + columns;
  if (file_.has_parent_path()) std::filesystem::create_directories(file_.parent_path());
  std::ifstream stream(file_);
  if (!stream) return;
  const std::runtime_error foreign(
      file_.string() + ": not a table of this experiment: delete it, or give another --output");
  std::string line;
  if (!std::getline(stream, line) || line.compare(0, 2, "# ") != 0) throw foreign;
  if (line.substr(2) != settings) {
    throw std::runtime_error(
        fmt::format("{}: was made with '{}', not '{}': delete it, or give another --output",
                    file_.string(), line.substr(2), settings));
  }
  if (!std::getline(stream, line) || line != columns) throw foreign;
  while (std::getline(stream, line)) {
    size_t end = 0;
    for (size_t i = 0; i < keys.size(); ++i) {
      end = line.find(',', end + (i > 0));
      if (end == std::string::npos) throw foreign;
    }
    std::vector<double> row;
    const char* next = line.c_str() + end;
    while (*next == ',') {
      char* after;
      row.push_back(std::strtod(next + 1, &after));
      if (after == next + 1) throw foreign;
      next = after;
    }
    if (*next != '\0' || row.size() != values.size()) throw foreign;
    const std::string key = line.substr(0, end);
    if (!Has(key)) {
      index_[key] = groups_.size();
      groups_.push_back({key, {}});
    }
    groups_[index_[key]].second.push_back(row);
  }
}

void Results::Add(const std::string& key, Rows rows) {
  if (Has(key)) throw std::invalid_argument("the table has '" + key + "' already");
  index_[key] = groups_.size();
  groups_.emplace_back(key, std::move(rows));
  std::string text = header_ + "\n";
  for (const auto& [name, group] : groups_) {
    for (const std::vector<double>& row : group)
      text += fmt::format("{},{:.8g}\n", name, fmt::join(row, ","));
  }
  WriteAtomically(file_, text);
}

bool RunJobs(Process& process, const std::vector<Job>& jobs, Results& results) {
  double left = 0, done = 0;
  for (const Job& job : jobs) left += results.Has(job.key) ? 0 : job.weight;
  ProgressLine line;
  const auto start = std::chrono::steady_clock::now();
  for (size_t i = 0; i < jobs.size(); ++i) {
    const Job& job = jobs[i];
    if (results.Has(job.key)) continue;
    const auto progress = [&](double share) {
      if (process.stopping()) throw Stopped();
      const double seconds =
          std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      const double now = done + share * job.weight;
      if (!line.shown()) return;
      const std::string rest = now > 0 ? Duration(seconds * (left - now) / now) + " left" : "";
      line.Show(fmt::format("{} of {}: {}  {:.0f} %  {}", i + 1, jobs.size(), job.key, 100 * share,
                            rest));
    };
    try {
      progress(0);
      results.Add(job.key, job.run(progress));
    } catch (const Stopped&) {
      line.Clear();
      std::cerr << "stopped; the same command goes on from here\n";
      return false;
    }
    done += job.weight;
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (!line.shown())
      std::cerr << fmt::format("{} of {}: {} done, {} left\n", i + 1, jobs.size(), job.key,
                               Duration(seconds * (left - done) / done));
  }
  return true;
}

}  // namespace plumb
