#include "common/lcm_log_reader.h"

#include <endian.h>
#include <fmt/format.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <utility>

namespace plumb {
namespace {

// Event: sync word, number, utime, length of channel, length of data; big-endian; then channel and
// data.
constexpr uint32_t kSync = 0xeda1da01;
constexpr size_t kHead = 28;
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

LcmLogReader::LcmLogReader(std::string file) : file_(std::move(file)) {
  std::error_code error;
  if (std::filesystem::is_directory(file_, error))
    throw std::runtime_error(file_ + ": is a folder");
  stream_.open(file_, std::ios::binary);
  if (!stream_) throw std::runtime_error(file_ + ": cannot be opened");
}

void LcmLogReader::RequireReadable() const {
  if (stream_.bad())
    throw std::runtime_error(fmt::format("{}: cannot be read at byte {}", file_, position_));
}

bool LcmLogReader::ReadHead(Head& head) {
  std::array<char, kHead> bytes;
  stream_.read(bytes.data(), bytes.size());
  RequireReadable();
  cut_off_ = !stream_ && stream_.gcount() > 0;
  if (!stream_) return false;
  head = {static_cast<int64_t>(BigEndian<uint64_t>(&bytes[12])), BigEndian<uint32_t>(&bytes[20]),
          BigEndian<uint32_t>(&bytes[24])};
  if (BigEndian<uint32_t>(bytes.data()) == kSync && head.channel != 0 &&
      head.channel <= kLongestChannel && head.data <= kLongestData) {
    return true;
  }
  if (position_ == 0) throw std::runtime_error(file_ + ": is no LCM log");
  throw std::runtime_error(fmt::format("{}: damaged at byte {}", file_, position_));
}

bool LcmLogReader::Read(LcmLogEvent& event) {
  Head head;
  if (!ReadHead(head)) return false;
  event.utime = head.utime;
  event.channel.resize(head.channel);
  event.data.resize(head.data);
  stream_.read(event.channel.data(), head.channel);
  stream_.read(reinterpret_cast<char*>(event.data.data()), head.data);
  RequireReadable();
  cut_off_ = !stream_;
  if (cut_off_) return false;
  position_ += static_cast<int64_t>(kHead) + head.channel + head.data;
  return true;
}

bool LcmLogReader::Skip(int64_t& utime) {
  Head head;
  if (!ReadHead(head)) return false;
  utime = head.utime;
  const int64_t rest = static_cast<int64_t>(head.channel) + head.data;
  stream_.ignore(rest);
  RequireReadable();
  cut_off_ = stream_.gcount() < rest;
  if (cut_off_) return false;
  position_ += static_cast<int64_t>(kHead) + head.channel + head.data;
  return true;
}

void LcmLogReader::Seek(int64_t position) {
  stream_.clear();
  stream_.seekg(position);
  position_ = position;
}

}  // namespace plumb
