#include "dashboard/outbox.h"

#include <algorithm>
#include <utility>

namespace plumb {
namespace {

constexpr size_t kOverhead = 64;  // of an item, beyond its payload

Outbox::Item TimeOf(int64_t utime) {
  return {Outbox::Kind::kControl, true, 0, utime,
          std::make_shared<const std::string>(TimeFrame(utime))};
}

}  // namespace

void Outbox::SetTime(int64_t utime) { Push(TimeOf(utime)); }

void Outbox::Push(Item item) {
  Account(item, true);
  std::weak_ptr<const std::string> history;
  if (item.kind == Kind::kHistory) history = std::exchange(item.payload, nullptr);
  items_.push_back({std::move(item), std::move(history)});
  MakeRoom();
}

std::optional<Outbox::Item> Outbox::Pop() {
  while (!items_.empty() && items_.front().forgotten()) items_.pop_front();
  if (items_.empty()) return std::nullopt;
  auto& [next, history] = items_.front();
  // History is of any time, also of the machine's, from before the run's was known.
  const bool later =
      next.is_message() && next.kind != Kind::kHistory && *next.utime - kTimeStep >= told_;
  if (later || next.tells_time()) told_ = *next.utime;
  if (later) return TimeOf(told_);
  Item item = std::move(next);
  if (item.kind == Kind::kHistory) item.payload = history.lock();
  items_.pop_front();
  Account(item, false);
  return item;
}

void Outbox::Forget(uint32_t subscription) {
  std::erase_if(items_, [&](const Waiting& waiting) {
    const Item& item = waiting.item;
    const bool gone = item.is_message() && item.subscription == subscription;
    if (gone) Account(item, false);
    return gone;
  });
}

void Outbox::MakeRoom() {
  for (const Kind kind : {Kind::kFast, Kind::kSlow}) {
    while (bytes_ > kMaxBytes) {
      const auto oldest =
          std::ranges::find(items_, kind, [](const Waiting& waiting) { return waiting.item.kind; });
      if (oldest == items_.end()) break;
      Account(oldest->item, false);
      items_.erase(oldest);
      ++dropped_;
    }
  }
}

void Outbox::Account(const Item& item, bool added) {
  if (item.kind == Kind::kHistory) return;
  const size_t size = item.payload->size() + kOverhead;
  size_t& count = item.kind == Kind::kControl ? control_bytes_ : bytes_;
  count += added ? size : -size;
}

}  // namespace plumb
