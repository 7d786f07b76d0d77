#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string_view>

#include "common/message_walk.h"
#include "dashboard/history.h"

namespace plumb {

/// The numbers by which messages are told apart, if the type has them, when it is, and what it says
/// besides numbers: of what is visited. Not thread-safe.
class MessageNumbers : public MessageVisitor {
 public:
  std::optional<History::Step> step() const {
    if (!iteration_) return std::nullopt;
    return History::Step{*iteration_, update_};
  }
  int64_t utime() const { return utime_; }
  size_t words() const { return words_; }

 private:
  void Field(std::string_view name) override { name_ = name; }
  void BeginStruct() override { ++depth_; }
  void EndStruct() override { --depth_; }
  void BeginArray(size_t) override { name_ = {}; }
  void EndArray() override {}
  void Integer(int64_t value) override {
    if (depth_ != 1) return;
    // A controller counts policies, and the episodes of each: what each returned is not forgotten.
    const bool policy = name_ == "policy_iteration" && value >= 0;
    if (name_ == "iteration" || policy) iteration_ = value;
    if (name_ == "update" || name_ == "num_episodes") update_ = value;
    if (name_ == "utime") utime_ = value;
    if (name_ == "state" || name_ == "phase") Word(static_cast<size_t>(value));  // names, in fact
  }
  void Float(float) override {}
  void Double(double) override {}
  void Boolean(bool value) override { Word(value); }
  void Text(std::string_view text) override { Word(std::hash<std::string_view>()(text)); }
  void Word(size_t hash) { words_ = words_ * 31 + hash; }

  std::string_view name_;
  int depth_ = 0;
  std::optional<int64_t> iteration_;
  int64_t update_ = 0, utime_ = 0;
  size_t words_ = 0;
};

}  // namespace plumb
