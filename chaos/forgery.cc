#include "chaos/forgery.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <utility>

#include "chaos/mad_numbers.h"
#include "common/lockstep/participant.h"
#include "common/seal.h"
#include "common/special_numbers.h"
#include "drivers/can/frame.h"
#include "drivers/protocols/cansimple.h"
#include "plumb/driver_request_t.hpp"

namespace plumb {
namespace {

constexpr size_t kMostRemembered = 200;  // messages of a channel

std::vector<uint8_t> RandomBytes(Random& random, size_t size) {
  std::vector<uint8_t> bytes(size);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random.Bits());
  return bytes;
}

std::vector<int> NodesOf(const RobotDescription& robot) {
  std::vector<int> nodes;
  for (const int joint : robot.driven())
    nodes.push_back(robot.joints[static_cast<size_t>(joint)].motor.node);
  return nodes;
}

Frame RandomFrame(Random& random) {
  Frame frame;
  frame.id = random.Bits() & 0x7FF;
  frame.remote = random.Below(8) == 0;
  frame.length = static_cast<uint8_t>(random.Below(9));
  if (frame.remote) return frame;
  for (size_t i = 0; i < frame.length; ++i) frame.data[i] = static_cast<uint8_t>(random.Bits());
  return frame;
}

std::string ForgedFrame(const std::vector<int>& nodes, Random& random) {
  using namespace cansimple;
  const int node = nodes[random.Below(nodes.size())];
  const std::array frames{Make(kSetInputTorque, node, {1.25}),
                          Make(kSetInputTorqueShort, node, {-0.75}),
                          Make(kEstop, node),
                          Make(kEstop, kBroadcastNode),
                          Make(kSetAxisState, node, {kClosedLoopControl}),
                          Make(kHeartbeat, node, {0, kIdle, 0, 0}),
                          Make(kHeartbeat, node, {0, kClosedLoopControl, 0, 0}),
                          Make(kHeartbeat, node, {1 << 24, kIdle, 0, 0}),
                          Make(kGetEncoderEstimates, node, {kNaN, kNaN}),
                          Make(kGetEncoderEstimates, node, {1e9, 0}),
                          Make(kGetEncoderEstimates, node, {0, 0}),
                          Make(kGetTemperature, node, {200, 200})};
  return ToText(frames[random.Below(frames.size())]);
}

lockstep_post_t Post(lockstep_topic_t topic, std::vector<uint8_t> data) {
  lockstep_post_t post;
  post.topic = std::move(topic);
  post.arrival = 0;
  post.size = static_cast<int32_t>(data.size());
  post.data = std::move(data);
  return post;
}

}  // namespace

Forgery::Forgery(const RobotDescription& robot, std::string bus, const SigningKey& key,
                 const SigningKey& wrong_key)
    : nodes_(NodesOf(robot)),
      robot_(robot.name),
      bus_(std::move(bus)),
      key_(key),
      wrong_key_(wrong_key) {}

void Forgery::Learn(const lockstep_post_t& post) {
  if (post.topic.kind == lockstep_topic_t::FRAME) return;
  auto& heard = heard_[post.topic.name];
  // The first ones, which are the oldest, and the newest.
  if (heard.size() == kMostRemembered) heard.pop_back();
  heard.push_back(post.data);
}

std::optional<lockstep_post_t> Forgery::Make(const Prank& prank, Random& random) const {
  if (prank.what == Mischief::kForgeFrame) {
    const std::string text = ForgedFrame(nodes_, random);
    return Post(BusTopic(bus_), {text.begin(), text.end()});
  }
  if (prank.what == Mischief::kGarbage && prank.topic == kBus) {
    const std::string text = ToText(RandomFrame(random));
    return Post(BusTopic(bus_), {text.begin(), text.end()});
  }
  const lockstep_topic_t channel = ChannelTopic(prank.topic);
  if (prank.what == Mischief::kGarbage)
    return Post(channel, RandomBytes(random, random.Below(300)));
  const auto heard = heard_.find(prank.topic);
  if (heard == heard_.end()) return std::nullopt;
  if (prank.what == Mischief::kReplay)
    return Post(channel, heard->second[random.Below(heard->second.size())]);
  return Post(channel, Forged(prank.topic, random));
}

std::vector<uint8_t> Forgery::Forged(const std::string& channel, Random& random) const {
  const std::vector<uint8_t>& model = heard_.at(channel).back();
  Seal seal = FindSeal(model).value_or(Seal{});
  const std::span<const uint8_t> message = Unsealed(model);
  std::vector<uint8_t> bytes = WithMadNumbers(channel, message, random)
                                   .value_or(std::vector<uint8_t>(message.begin(), message.end()));
  const size_t way = random.Below(4);
  if (way == 0) return bytes;  // as another program says it
  bytes.resize(bytes.size() + kSealSize);
  seal.counter += 1 + static_cast<int64_t>(random.Below(1000));
  if (way == 1) seal.sender ^= 2;  // else it pretends to be the one whom it imitates
  const bool copied = way == 2;    // with a signature that is another message's
  WriteSeal(seal, copied ? nullptr : &wrong_key_, robot_, bus_, channel, bytes);
  return bytes;
}

bool Forgery::Madden(lockstep_post_t& post, Random& random) const {
  const std::optional<Seal> seal = FindSeal(post.data);
  if (!seal) return false;
  auto mad = WithMadNumbers(post.topic.name, Unsealed(post.data), random);
  if (!mad) return false;
  mad->resize(mad->size() + kSealSize);
  WriteSeal(*seal, &key_, robot_, bus_, post.topic.name, *mad);
  post.data = std::move(*mad);
  post.size = static_cast<int32_t>(post.data.size());
  return true;
}

}  // namespace plumb
