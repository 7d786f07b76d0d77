#include "cli/virtual_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string_view>

namespace plumb {
namespace {

/// The interface's name, as candump would print it; of what is no interface, the bus's.
std::string_view Interface(std::string_view url, const std::vector<BusDescription>& buses) {
  constexpr std::string_view kSocketCan = "socketcan:";
  if (url.starts_with(kSocketCan)) return url.substr(kSocketCan.size());
  const auto bus = std::ranges::find_if(
      buses, [&](const BusDescription& one) { return InnermostBus(one.url) == url; });
  return bus == buses.end() || bus->name.empty() ? "can0" : std::string_view(bus->name);
}

}  // namespace

VirtualRun::VirtualRun(const std::filesystem::path& folder, const std::string& lcm_url,
                       const Records& records)
    : coordinator_((folder / "clock").string()) {
  if (!lcm_url.starts_with("memq:")) {
    try {
      mirror_.emplace(lcm_url);
    } catch (const std::runtime_error& error) {
      mirror_failure_ = error.what();
    }
  }
  if (!records.messages.empty()) {
    // First, for what is refused: what an earlier log has is not lost for it.
    beside_messages_.emplace(records.messages, records.about);
    messages_.emplace(records.messages);
  }
  if (!records.frames.empty()) {
    frames_file_ = records.frames;
    buses_ = records.buses;
    frames_.open(frames_file_);
    RequireFrames();
  }
  coordinator_.on_post = [this](const lockstep_post_t& post, const std::string&) { OnPost(post); };
}

VirtualRun::~VirtualRun() = default;

void VirtualRun::OnPost(const lockstep_post_t& post) {
  if (failure_) return;
  try {
    Record(post);
  } catch (...) {
    failure_ = std::current_exception();
  }
}

void VirtualRun::Record(const lockstep_post_t& post) {
  if (post.topic.kind == lockstep_topic_t::FRAME) {
    if (!frames_.is_open()) return;
    frames_ << fmt::format("({}.{:06}) {} ", post.arrival / 1'000'000, post.arrival % 1'000'000,
                           Interface(post.topic.name, buses_));
    frames_.write(reinterpret_cast<const char*>(post.data.data()), post.size);
    frames_ << '\n';
    RequireFrames();
    return;
  }
  if (mirror_) mirror_->Publish(post.topic.name, post.data);
  if (!messages_) return;
  messages_->Write(post.arrival, post.topic.name, post.data);
  beside_messages_->Hear(post.topic.name, post.data);
}

void VirtualRun::RequireFrames() const {
  if (!frames_)
    throw std::runtime_error(
        fmt::format("{}: cannot be written: {}", frames_file_, std::strerror(errno)));
}

void VirtualRun::Rethrow() {
  if (failure_) std::rethrow_exception(failure_);
}

void VirtualRun::Finish() {
  Rethrow();
  if (mirror_) mirror_->Flush();
  if (messages_) messages_->Flush();
  messages_.reset();
  if (!frames_.is_open()) return;
  frames_.close();
  RequireFrames();
}

}  // namespace plumb
