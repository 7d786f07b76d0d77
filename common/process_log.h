#pragma once

#include <fmt/format.h>
#include <spdlog/formatter.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/stdout_color_sinks.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "common/clock.h"
#include "common/log_limit.h"
#include "common/outside_text.h"

// What a process's log is written by. Thread-safe as spdlog wants it: formatters by one thread at a
// time, sinks by all.
namespace plumb {

/// Messages of the log quote what came from outside: one line, Printable.
class PrintableFormatter : public spdlog::formatter {
 public:
  explicit PrintableFormatter(std::unique_ptr<spdlog::formatter> inner)
      : inner_(std::move(inner)) {}

  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& line) override {
    const std::string text = Printable({message.payload.data(), message.payload.size()});
    spdlog::details::log_msg printable = message;
    printable.payload = text;
    inner_->format(printable, line);
    message.color_range_start = printable.color_range_start;
    message.color_range_end = printable.color_range_end;
  }
  std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<PrintableFormatter>(inner_->clone());
  }

 private:
  std::unique_ptr<spdlog::formatter> inner_;
};

/// Writes to standard error what LogLimit lets through. What a person has asked for in detail, from
/// debug on, is not limited.
class LimitedSink : public spdlog::sinks::base_sink<std::mutex> {
 private:
  void sink_it_(const spdlog::details::log_msg& line) override {
    if (line.level < spdlog::level::info) return out_.log(line);
    const std::optional<int64_t> held_back =
        limit_.Admit({line.payload.data(), line.payload.size()}, clock_.Now());
    if (!held_back) return;
    if (*held_back > 0) {
      const std::string note = fmt::format("{} lines like the next one are left out", *held_back);
      out_.log({line.logger_name, line.level, note});
    }
    out_.log(line);
  }
  void flush_() override { out_.flush(); }
  void set_pattern_(const std::string& pattern) override { out_.set_pattern(pattern); }
  void set_formatter_(std::unique_ptr<spdlog::formatter> formatter) override {
    out_.set_formatter(std::move(formatter));
  }

  spdlog::sinks::stderr_color_sink_st out_;
  LogLimit limit_;
  const Clock clock_;
};

}  // namespace plumb
