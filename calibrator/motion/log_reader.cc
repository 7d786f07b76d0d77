#include "calibrator/motion/log_reader.h"

#include <endian.h>
#include <fmt/format.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <span>
#include <stdexcept>
#include <vector>

#include "common/seal.h"

namespace plumb {
namespace {

// Event: sync word, number, utime, length of channel, length of data; big-endian; then channel and
// data.
constexpr uint32_t kSync = 0xeda1da01;
constexpr size_t kHeader = 28;
constexpr uint32_t kLongestChannel = 1000, kLongestData = 64u << 20;

template <class T>
T BigEndian(const char* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  if constexpr (sizeof(T) == 4)
    return be32toh(value);
  else
    return be64toh(value);
}

}  // namespace

int64_t ReadLog(
    const std::string& file,
    const std::function<bool(const std::string&, const void*, int, int64_t)>& on_event) {
  std::error_code error;
  if (std::filesystem::is_directory(file, error)) throw std::runtime_error(file + ": is a folder");
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw std::runtime_error(file + ": cannot be opened");
  char header[kHeader];
  std::string channel;
  std::vector<char> data;
  int64_t events = 0;
  for (;;) {
    const auto at = stream.tellg();
    if (!stream.read(header, kHeader)) return events;
    const auto channel_length = BigEndian<uint32_t>(header + 20),
               data_length = BigEndian<uint32_t>(header + 24);
    if (BigEndian<uint32_t>(header) != kSync || channel_length == 0 ||
        channel_length > kLongestChannel || data_length > kLongestData) {
      if (events == 0) throw std::runtime_error(file + ": is no LCM log");
      throw std::runtime_error(
          fmt::format("{}: damaged at byte {}", file, static_cast<int64_t>(at)));
    }
    channel.resize(channel_length);
    data.resize(data_length);
    if (!stream.read(channel.data(), channel_length) || !stream.read(data.data(), data_length))
      return events;
    ++events;
    const std::span<const uint8_t> message =
        Unsealed({reinterpret_cast<const uint8_t*>(data.data()), data.size()});
    if (!on_event(channel, message.data(), static_cast<int>(message.size()),
                  static_cast<int64_t>(BigEndian<uint64_t>(header + 12)))) {
      return events;
    }
  }
}

}  // namespace plumb
