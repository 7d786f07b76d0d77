#include "dashboard/gateway.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "common/decoded.h"
#include "common/message_json.h"
#include "common/message_schema.h"
#include "common/message_walk.h"
#include "dashboard/channels.h"
#include "dashboard/message_numbers.h"
#include "plumb/driver_status_t.hpp"
#include "robot/physical.h"

namespace plumb {
namespace {

constexpr int64_t kStatisticsPeriod = 500'000, kStatusPeriod = 1'000'000;  // [us]
constexpr size_t kLongestOfOthers = 64 << 10;  // [bytes] of a channel that is not of the page
constexpr int64_t kRewindPeriod = 100'000;     // [us]; that one has been is not news any faster

// In the order of their numbers, from 1 on.
constexpr std::string_view kServices[] = {"emergency_stop", "arm", "disarm", "confirm_placed"};

constexpr char kVirtual[] = "a run in virtual time hears nobody from outside";

constexpr char kGatewaySchema[] =
    R"({"title":"plumb.gateway","type":"object","properties":{"utime":{"type":"integer"},)"
    R"("clock":{"type":"string"},"speed":{"type":"number"},"clients":{"type":"integer"},)"
    R"("dropped":{"type":"integer"},"rewinds":{"type":"integer"}}})";
constexpr char kChannelsSchema[] =
    R"({"title":"plumb.channels","type":"object","properties":{"utime":{"type":"integer"},)"
    R"("channels":{"type":"array","items":{"type":"object","properties":{)"
    R"("channel":{"type":"string"},"type":{"type":"string"},"count":{"type":"integer"},)"
    R"("rate":{"type":"number"},"jitter_ms":{"type":"number"},)"
    R"("bytes_per_second":{"type":"number"},"undecodable":{"type":"integer"},)"
    R"("refused":{"type":"integer"},"intervals":{"type":"array","items":{"type":"integer"}},)"
    R"("age_ms":{"type":"number"}}}}}})";

}  // namespace

Gateway::Gateway(const RobotDescription& robot, Setting setting, Wishes::Request request)
    : robot_(robot),
      placement_(robot_),
      setting_(std::move(setting)),
      time_(setting_.kind),
      derived_(robot, topics_),
      wishes_(std::move(request), setting_.identity, setting_.has_key, setting_.lcm_url),
      statistics_topic_(
          topics_.Add("PLUMB_CHANNELS", "plumb.channels", kChannelsSchema, Topics::Keep::kNewest)),
      gateway_topic_(
          topics_.Add("PLUMB_GATEWAY", "plumb.gateway", kGatewaySchema, Topics::Keep::kNewest)) {
  topics_.newest = [this](uint32_t topic) { return Newest(topic); };
  for (const ChannelOfPage& channel : ChannelsOfPage()) {
    const MessageType* const type = FindMessageType(channel.type);
    const auto keep = channel.fast ? Topics::Keep::kNewest : Topics::Keep::kHistory;
    const uint32_t topic =
        topics_.Add(std::string(channel.name), QualifiedName(*type), JsonSchema(*type), keep);
    channels_[std::string(channel.name)] = {type, topic, channel.tells_time, {}};
  }
}

std::optional<Topics::Message> Gateway::Newest(uint32_t topic) const {
  if (auto derived = derived_.Newest(topic)) return derived;
  const auto found =
      std::ranges::find(channels_, topic, [](const auto& channel) { return channel.second.topic; });
  if (found == channels_.end() || found->second.last.empty()) return std::nullopt;
  Topics::Message message{time_.utime(), {}};
  AppendJson(*found->second.type, found->second.last, message.json);
  return message;
}

/// One that docs/messages.md does not know is offered when it is first heard, as if it were fast.
Gateway::Channel* Gateway::Find(const std::string& name, const MessageType* type) {
  const auto found = channels_.find(name);
  if (found != channels_.end()) return &found->second;
  // Nobody says in our place what only we say.
  if (!type || name.starts_with("PLUMB_") || channels_.size() >= Topics::kMaxTopics) return nullptr;
  const uint32_t topic =
      topics_.Add(name, QualifiedName(*type), JsonSchema(*type), Topics::Keep::kNewest);
  return &(channels_[name] = {type, topic, false, {}});
}

void Gateway::OnMessage(const std::string& name, std::span<const uint8_t> message, bool believed,
                        int64_t arrival, const Moment& moment) {
  using Verdict = ChannelStatistics::Verdict;
  const MessageType* const type = TypeOf(message);
  Channel* const channel = believed ? Find(name, type) : nullptr;
  MessageNumbers numbers;
  const bool good = channel && channel->type == type && WalkMessage(*type, message, numbers);
  statistics_.Add(name, type ? type->name : "", message.size(), arrival,
                  !believed ? Verdict::kRefused
                  : good    ? Verdict::kGood
                            : Verdict::kUndecodable);
  if (!believed && name == "DRIVER_STATUS") wishes_.OnUnbelieved();
  if (!good) return;
  if (channel->tells_time && numbers.utime() >= 0 && IsTime(numbers.utime())) {
    // One speaker's words come in order. A time of 0 is none.
    if (numbers.utime() > 0 && numbers.utime() < channel->utime)
      Rewind(numbers.utime(), moment.now);
    channel->utime = numbers.utime();
    const bool first = time_.utime() == 0;
    time_.OnMessage(numbers.utime(), FindSeal(message), moment.date, moment.now);
    if (first) topics_.SetTime(time_.utime());  // it may be earlier than what we said so far
  }
  const std::span<const uint8_t> content = Unsealed(message);
  const bool repeated = std::ranges::equal(content, channel->last);
  if (topics_.watched(channel->topic) || (topics_.wanted(channel->topic) && !repeated)) {
    std::string json;
    AppendJson(*type, message, json);
    topics_.Publish(channel->topic, Utime(moment), std::move(json), numbers.step(),
                    numbers.words());
  }
  Use(name, message, repeated, moment);
  const bool kept = content.size() <= kLongestOfOthers || IsChannelOfPage(name);
  channel->last.assign(content.begin(), kept ? content.end() : content.begin());
}

/// A log is played from an earlier place on, or another run has begun: what was said later has not
/// been said yet, and what repeats it is news.
void Gateway::Rewind(int64_t utime, int64_t now) {
  ++rewinds_;
  next_status_ = std::min(next_status_, now + kRewindPeriod);
  time_.Rewind(utime);
  topics_.Rewind(utime);
  for (auto& [name, channel] : channels_) {
    channel.utime = 0;
    channel.last.clear();
  }
}

void Gateway::Use(const std::string& channel, std::span<const uint8_t> message, bool repeated,
                  const Moment& moment) {
  if (channel == "ROBOT_STATE") {
    state_ = Decoded<robot_state_t>(message);
    if (state_) derived_.OnState(*state_, Utime(moment), moment.now);
  } else if (channel == "DRIVER_STATUS") {
    if (const auto status = Decoded<driver_status_t>(message))
      wishes_.OnStatus(*status, moment.now);
  } else if (channel == "PLACE_ROBOT") {
    place_ = Decoded<place_robot_t>(message);
  } else if (channel == "CONTROLLER_STATUS") {
    controller_ = Decoded<controller_status_t>(message);
  } else if (channel == "PARAMETER_DISTRIBUTION" && !repeated) {
    if (const auto distribution = Decoded<parameter_distribution_t>(message))
      derived_.OnDistribution(*distribution, Utime(moment));
  }
}

void Gateway::Tick(const Moment& moment) {
  wishes_.Tick(moment.now);
  if (moment.now >= next_statistics_) {
    next_statistics_ = moment.now + kStatisticsPeriod;
    topics_.Publish(statistics_topic_, Utime(moment), statistics_.Json(Utime(moment), moment.now));
  }
  if (moment.now >= next_status_) {
    next_status_ = moment.now + kStatusPeriod;
    topics_.Publish(
        gateway_topic_, Utime(moment),
        fmt::format(R"({{"utime":{},"clock":"{}","speed":{:.4g},"clients":{},"dropped":{},)"
                    R"("rewinds":{}}})",
                    Utime(moment), time_.kind_name(), time_.Speed(moment.now), topics_.viewers(),
                    topics_.dropped(), rewinds_));
  }
}

void Gateway::Finish(const Moment& moment) {
  next_statistics_ = next_status_ = moment.now;
  Tick(moment);
}

void Gateway::Join(Viewer& viewer) {
  viewer.Say(ServerInfoText("Plumbline: " + robot_.name, fmt::format("{:x}", setting_.identity)));
  if (time_.utime() > 0) viewer.SetTime(time_.utime());
  topics_.Join(viewer);
  viewer.Say(AdvertiseServicesText(kServices));
}

void Gateway::Leave(Viewer& viewer) {
  wishes_.Leave(viewer);
  topics_.Leave(viewer);
}

void Gateway::OnText(Viewer& viewer, std::string_view text) {
  try {
    const ClientMessage said = ParseClientText(text);
    topics_.Unsubscribe(viewer, said.unsubscribe);
    topics_.Subscribe(viewer, said.subscribe);
  } catch (const std::exception& error) {
    viewer.Say(StatusText(2, error.what()));
  }
}

void Gateway::OnBinary(Viewer& viewer, std::span<const uint8_t> frame, const Moment& moment) {
  try {
    Call(viewer, *ParseClientBinary(frame).call, moment);
  } catch (const std::exception& error) {
    viewer.Say(StatusText(2, error.what()));
  }
}

std::string Gateway::WhyNotArm() const {
  return time_.kind() == RunTime::Kind::kVirtual ? kVirtual : "";
}

// A stop is asked for whatever the run is: in virtual time it ends the run.
void Gateway::Call(Viewer& viewer, const ClientMessage::Call& call, const Moment& moment) {
  const auto ask = [&](int8_t request) {
    wishes_.Ask(request, viewer, call, moment.utime, moment.now);
  };
  const auto refuse = [&](const std::string& why) { AnswerCall(viewer, call, false, why); };
  if (call.service == 0 || call.service > std::size(kServices)) {
    viewer.Say(ServiceFailureText(call.service, call.id, "there is no such service"));
  } else if (kServices[call.service - 1] == "emergency_stop") {
    ask(driver_request_t::ESTOP);
  } else if (const std::string why = WhyNotArm(); !why.empty()) {
    refuse(why);
  } else if (kServices[call.service - 1] == "disarm") {
    ask(driver_request_t::DISARM);
  } else if (!viewer.why_not_arm.empty()) {
    refuse(viewer.why_not_arm);
  } else if (kServices[call.service - 1] == "arm") {
    ask(driver_request_t::ARM);
  } else {
    const DriverWish::Answer answer = Placed();
    AnswerCall(viewer, call, answer.granted, answer.text);
  }
}

/// The controller sees for itself when the robot is where it is to be, and begins: what a person
/// needs is to be told what is still missing.
DriverWish::Answer Gateway::Placed() const {
  if (!controller_) return {false, "no controller is heard"};
  if (controller_->phase == controller_status_t::RUNNING) return {true, "the episode has begun"};
  if (controller_->phase != controller_status_t::PLACING)
    return {false, "the controller does not ask for the robot to be placed" +
                       (controller_->reason.empty() ? "" : ": " + controller_->reason)};
  const auto size = static_cast<size_t>(robot_.num_positions());
  if (!place_ || !state_ || place_->q.size() != size || state_->q.size() != size)
    return {false, "the controller begins by itself when the robot has rested"};
  const auto map = [](const std::vector<double>& q) {
    return Eigen::VectorXd::Map(q.data(), static_cast<Eigen::Index>(q.size()));
  };
  const double tolerance = robot_.controller.place_tolerance;
  const Eigen::VectorXd distance = placement_.Distance(map(state_->q), map(place_->q));
  for (Eigen::Index i = 0; i < distance.size(); ++i) {
    if (std::abs(distance[i]) <= tolerance) continue;
    if (placement_.flat()) {
      const auto joint = static_cast<size_t>(i);
      return {false,
              fmt::format("{} is at {:.3f}, and is to be at {:.3f}, within {:.3f}",
                          placement_.name(i), state_->q[joint], place_->q[joint], tolerance)};
    }
    return {false, fmt::format("{} is {:.3f} from where it is to be, within {:.3f}",
                               placement_.name(i), std::abs(distance[i]), tolerance)};
  }
  return {true, "the robot is where it is to be"};
}

int64_t Gateway::Utime(const Moment& moment) const {
  return time_.utime() != 0 ? time_.utime() : moment.utime;
}

}  // namespace plumb
