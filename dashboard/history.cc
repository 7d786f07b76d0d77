#include "dashboard/history.h"

#include <algorithm>
#include <utility>

namespace plumb {

void History::Add(Entry entry) {
  const auto remove = [this](auto which) {
    bytes_ -= which->json->size();
    entries_.erase(which);
  };
  if (!entries_.empty() && *entries_.back().json == *entry.json) return;
  if (entry.step && !entries_.empty()) {
    if (entries_.back().step && entry.step->iteration < entries_.back().step->iteration) {
      entries_.clear();
      bytes_ = 0;
    }
    const auto same = std::ranges::find(entries_, entry.step, &Entry::step);
    if (same != entries_.end()) remove(same);
  }
  bytes_ += entry.json->size();
  entries_.push_back(std::move(entry));
  const size_t most = entries_.back().step ? kMaxSteps : kMaxMessages;
  while (entries_.size() > 1 && (entries_.size() > most || bytes_ > kMaxBytes))
    remove(entries_.begin());
}

}  // namespace plumb
