#include "dashboard/history.h"

#include <algorithm>
#include <utility>

namespace plumb {

void History::Add(Entry entry) {
  if (!entries_.empty() && *entries_.back().json == *entry.json) return;
  const bool went_back = entry.step && std::ranges::any_of(entries_, [&](const Entry& other) {
                           return other.step > entry.step;
                         });
  if (went_back) {
    std::erase_if(entries_, [&](const Entry& other) {
      const bool again = other.step >= entry.step;
      if (again) bytes_ -= other.json->size();
      return again;
    });
  }
  const auto alike = [&](const Entry& other) {
    return other.step == entry.step && other.words == entry.words;
  };
  if (entries_.size() > 1 && alike(entries_.back()) && alike(entries_[entries_.size() - 2])) {
    bytes_ -= entries_.back().json->size();
    entries_.pop_back();
  }
  bytes_ += entry.json->size();
  entries_.push_back(std::move(entry));
  const size_t most = entries_.back().step ? kMaxSteps : kMaxMessages;
  while (entries_.size() > 1 && (entries_.size() > most || bytes_ > kMaxBytes)) {
    bytes_ -= entries_.front().json->size();
    entries_.pop_front();
  }
}

void History::Rewind(int64_t utime) {
  while (!entries_.empty() && entries_.back().utime >= utime) {
    bytes_ -= entries_.back().json->size();
    entries_.pop_back();
  }
}

}  // namespace plumb
