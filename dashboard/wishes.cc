#include "dashboard/wishes.h"

#include <algorithm>

#include "common/message_json.h"

namespace plumb {
namespace {

constexpr size_t kMaxAskers = 100;  // of a wish

}  // namespace

void AnswerCall(Viewer& viewer, const ClientMessage::Call& call, bool ok, std::string_view text) {
  std::string json = ok ? R"({"ok":true,"text":)" : R"({"ok":false,"text":)";
  AppendJsonText(text, json);
  viewer.Say(ServiceResponse(call.service, call.id, json + "}"), true);
}

void Wishes::Ask(int8_t request, Viewer& viewer, const ClientMessage::Call& call, int64_t utime,
                 int64_t now) {
  auto same = std::ranges::find(open_, request, &Open::request);
  if (same == open_.end()) {
    open_.push_back({request, DriverWish(request, ++identity_, utime, now, has_key_), now, {}});
    same = std::prev(open_.end());
  }
  if (same->askers.size() >= kMaxAskers)
    return AnswerCall(viewer, call, false, "too many are asking for it already");
  same->askers.push_back({&viewer, call});
  if (!same->wish.arms()) Say(*same, now);
}

void Wishes::OnStatus(const driver_status_t& status, int64_t now) {
  unbelieved_ = false;
  for (Open& open : open_) {
    open.wish.OnStatus(status);
    if (open.wish.arms()) Say(open, now);
  }
  Answer(now);
}

void Wishes::Tick(int64_t now) {
  for (Open& open : open_) {
    if (now >= open.again) Say(open, now);
  }
  Answer(now);
}

void Wishes::Leave(const Viewer& viewer) {
  for (Open& open : open_)
    std::erase_if(open.askers, [&](const auto& asker) { return asker.first == &viewer; });
}

void Wishes::Say(Open& open, int64_t now) {
  open.again = now + DriverWish::kAgain;
  if (const auto request = open.wish.Tick()) request_(*request);
}

void Wishes::Answer(int64_t now) {
  for (auto open = open_.begin(); open != open_.end();) {
    const auto answer = open->wish.FindAnswer(now, unbelieved_, where_);
    if (!answer) {
      ++open;
      continue;
    }
    for (const auto& [viewer, call] : open->askers)
      AnswerCall(*viewer, call, answer->granted, answer->text);
    open = open_.erase(open);
  }
}

}  // namespace plumb
