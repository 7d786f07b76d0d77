#include "experiments/results.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <span>
#include <sstream>
#include <stdexcept>

#include "common/atomic_file.h"

namespace plumb {
namespace {

// What rank 0 has in a file, for all of them; nothing if there is none.
std::optional<std::string> Read(const std::filesystem::path& file, const Ranks& ranks) {
  std::string text;
  int64_t size = -1;
  if (std::ifstream stream(file); ranks.rank() == 0 && stream) {
    text.assign(std::istreambuf_iterator<char>(stream), {});
    size = static_cast<int64_t>(text.size());
  }
  ranks.Broadcast(std::as_writable_bytes(std::span(&size, 1)));
  if (size < 0) return {};
  text.resize(static_cast<size_t>(size));
  ranks.Broadcast(std::as_writable_bytes(std::span(text)));
  return text;
}

// A number as the table has it: whoever goes on without a break decides by the same numbers as
// whoever reads the table.
std::string Written(double number) { return fmt::format("{:.8g}", number); }

}  // namespace

Results::Results(std::filesystem::path file, const std::string& settings,
                 std::vector<std::string> keys, std::vector<std::string> values, const Ranks& ranks)
    : file_(std::move(file)), ranks_(ranks), values_(values.size()) {
  if (ranks.rank() == 0) {
    lock_.emplace("results " + NameOfFile(file_),
                  file_.string() + ": another process is at work on it: give another --output");
    if (file_.has_parent_path()) std::filesystem::create_directories(file_.parent_path());
  }
  const std::string columns = fmt::format("{},{}", fmt::join(keys, ","), fmt::join(values, ","));
  header_ = "# " + settings + "\n" + columns;
  const std::optional<std::string> text = Read(file_, ranks);
  if (!text) return;
  std::istringstream stream(*text);
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
    if (*next != '\0' || row.size() != values_) throw foreign;
    const std::string key = line.substr(0, end);
    if (!Has(key)) {
      index_[key] = groups_.size();
      groups_.push_back({key, {}});
    }
    groups_[index_[key]].second.push_back(row);
  }
}

void Results::Arrange(const std::vector<std::string>& keys) {
  for (size_t i = 0; i < keys.size(); ++i) place_[keys[i]] = i + 1;
}

void Results::Add(const std::string& key, Rows rows) {
  if (Has(key)) throw std::invalid_argument("the table has '" + key + "' already");
  for (std::vector<double>& row : rows) {
    for (double& number : row) number = std::strtod(Written(number).c_str(), nullptr);
  }
  index_[key] = groups_.size();
  groups_.emplace_back(key, std::move(rows));
  if (ranks_.rank() != 0) return;
  std::vector<const std::pair<std::string, Rows>*> arranged;
  for (const auto& group : groups_) arranged.push_back(&group);
  std::ranges::stable_sort(arranged, {}, [&](const auto* group) {
    const auto place = place_.find(group->first);
    return place == place_.end() ? 0 : place->second;
  });
  std::string text = header_ + "\n";
  for (const auto* group : arranged) {
    for (const std::vector<double>& row : group->second) {
      text += group->first;
      for (const double number : row) text += "," + Written(number);
      text += "\n";
    }
  }
  WriteAtomically(file_, text);
}

}  // namespace plumb
