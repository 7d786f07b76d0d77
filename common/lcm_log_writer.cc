#include "common/lcm_log_writer.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <lcm/lcm-cpp.hpp>
#include <stdexcept>
#include <utility>

namespace plumb {

LcmLogWriter::LcmLogWriter(std::string file)
    : file_(std::move(file)), log_(std::make_unique<lcm::LogFile>(file_, "w")) {
  if (!log_->good()) Fail();
}

LcmLogWriter::~LcmLogWriter() = default;

void LcmLogWriter::Write(int64_t utime, const std::string& channel,
                         std::span<const uint8_t> message) {
  lcm::LogEvent event{};
  event.timestamp = utime;
  event.channel = channel;
  event.datalen = static_cast<int32_t>(message.size());
  event.data = const_cast<uint8_t*>(message.data());  // which it does not change
  if (log_->writeEvent(&event) != 0) Fail();
}

void LcmLogWriter::Flush() {
  if (std::fflush(log_->getFilePtr()) != 0) Fail();
}

void LcmLogWriter::Fail() const {
  throw std::runtime_error(fmt::format("{}: cannot be written: {}", file_, std::strerror(errno)));
}

}  // namespace plumb
