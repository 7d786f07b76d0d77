#include "common/lcm_datagrams.h"

#include <algorithm>
#include <utility>

namespace plumb {
namespace {

constexpr uint32_t kWhole = 0x4c433032, kFragment = 0x4c433033;  // "LC02", "LC03"
constexpr size_t kWholeHeader = 8, kFragmentHeader = 20, kMaxChannel = 63;
constexpr size_t kMaxPending = size_t{16} << 20, kMaxSenders = 64;

/// Big-endian.
uint32_t Word(std::span<const uint8_t> bytes, size_t at, size_t size) {
  uint32_t word = 0;
  for (size_t i = 0; i < size; ++i) word = word << 8 | bytes[at + i];
  return word;
}

/// Splits off the channel's name, which ends with a NUL. @return nothing if it does not.
std::optional<LcmDatagrams::Message> Split(std::span<const uint8_t> bytes) {
  const auto within = bytes.first(std::min(bytes.size(), kMaxChannel + 1));
  const auto end = std::ranges::find(within, uint8_t{0});
  if (end == within.end()) return std::nullopt;
  const auto length = static_cast<size_t>(end - within.begin());
  return LcmDatagrams::Message{{reinterpret_cast<const char*>(bytes.data()), length},
                               bytes.subspan(length + 1)};
}

}  // namespace

std::optional<LcmDatagrams::Message> LcmDatagrams::Take(uint64_t sender,
                                                        std::span<const uint8_t> datagram) {
  ++datagrams_;
  if (datagram.size() < kWholeHeader) return std::nullopt;
  const uint32_t kind = Word(datagram, 0, 4);
  if (kind == kFragment) return TakeFragment(sender, datagram);
  if (kind != kWhole) return std::nullopt;
  const auto message = Split(datagram.subspan(kWholeHeader));
  return message && wanted_(message->channel) ? message : std::nullopt;
}

std::optional<LcmDatagrams::Message> LcmDatagrams::TakeFragment(uint64_t sender,
                                                                std::span<const uint8_t> datagram) {
  if (datagram.size() < kFragmentHeader) return std::nullopt;
  const uint32_t sequence = Word(datagram, 4, 4), size = Word(datagram, 8, 4),
                 offset = Word(datagram, 12, 4), number = Word(datagram, 16, 2),
                 count = Word(datagram, 18, 2);
  std::span<const uint8_t> data = datagram.subspan(kFragmentHeader);
  auto found = incomplete_.find(sender);
  if (number == 0) {
    // A sender sends one message after the other: of the one before, something was lost.
    if (found != incomplete_.end()) Forget(found);
    const auto first = Split(data);
    if (!first || size > kMaxLcmMessage || !wanted_(first->channel)) return std::nullopt;
    found = incomplete_
                .emplace(sender, Incomplete{sequence,
                                            size,
                                            static_cast<uint16_t>(count),
                                            0,
                                            std::string(first->channel),
                                            {},
                                            datagrams_})
                .first;
    data = first->data;
  }
  if (found == incomplete_.end()) return std::nullopt;
  Incomplete& message = found->second;
  const bool next = message.sequence == sequence && message.size == size &&
                    message.count == count && message.next == number &&
                    message.data.size() == offset && data.size() <= size - offset;
  if (!next) {
    Forget(found);
    return std::nullopt;
  }
  pending_ -= message.data.capacity();
  message.data.insert(message.data.end(), data.begin(), data.end());
  pending_ += message.data.capacity();
  message.heard = datagrams_;
  if (++message.next < count) {
    MakeRoom();
    return std::nullopt;
  }
  complete_ = std::move(message);
  pending_ -= complete_.data.capacity();
  incomplete_.erase(found);
  if (complete_.data.size() != size) return std::nullopt;
  return Message{complete_.channel, complete_.data};
}

void LcmDatagrams::Forget(std::map<uint64_t, Incomplete>::iterator incomplete) {
  pending_ -= incomplete->second.data.capacity();
  incomplete_.erase(incomplete);
}

void LcmDatagrams::MakeRoom() {
  while (pending_ > kMaxPending || incomplete_.size() > kMaxSenders) {
    Forget(std::ranges::min_element(
        incomplete_, {}, [](const auto& incomplete) { return incomplete.second.heard; }));
  }
}

}  // namespace plumb
