#include "common/message_json.h"

#include <charconv>
#include <cmath>

#include "common/message_walk.h"
#include "common/outside_text.h"

namespace plumb {
namespace {

template <class Number>
void AppendNumber(Number number, std::string& json) {
  char digits[40];
  json.append(digits, std::to_chars(digits, digits + sizeof digits, number).ptr);
}

class JsonWriter : public MessageVisitor {
 public:
  explicit JsonWriter(std::string& json) : json_(json) {}

 private:
  void Field(std::string_view name) override {
    Separate();
    json_.append(1, '"').append(name).append("\":");
    first_ = true;
  }
  void BeginStruct() override { Begin('{'); }
  void EndStruct() override { End('}'); }
  void BeginArray(size_t) override { Begin('['); }
  void EndArray() override { End(']'); }
  void Integer(int64_t value) override {
    Separate();
    AppendNumber(value, json_);
  }
  void Float(float value) override { Real(value); }
  void Double(double value) override { Real(value); }
  void Boolean(bool value) override {
    Separate();
    json_ += value ? "true" : "false";
  }
  void Text(std::string_view value) override {
    Separate();
    AppendJsonText(value, json_);
  }

  template <class Number>
  void Real(Number value) {
    Separate();
    if (std::isfinite(value)) {
      AppendNumber(value, json_);
    } else {
      json_ += "null";
    }
  }
  void Separate() {
    if (!first_) json_ += ',';
    first_ = false;
  }
  void Begin(char bracket) {
    Separate();
    json_ += bracket;
    first_ = true;
  }
  void End(char bracket) {
    json_ += bracket;
    first_ = false;
  }

  std::string& json_;
  bool first_ = true;  // of its struct or array, or behind a name
};

}  // namespace

bool AppendJson(const MessageType& type, std::span<const uint8_t> message, std::string& json) {
  const size_t before = json.size();
  JsonWriter writer(json);
  if (WalkMessage(type, message, writer)) return true;
  json.resize(before);
  return false;
}

void AppendJsonText(std::string_view text, std::string& json) {
  json += '"';
  for (const char c : Printable(text, Lines::kMany)) {
    if (c == '"' || c == '\\') json += '\\';
    if (c == '\n') {
      json += "\\n";
    } else if (c == '\t') {
      json += "\\t";
    } else {
      json += c;
    }
  }
  json += '"';
}

void AppendJsonNumber(double number, std::string& json) {
  if (std::isfinite(number)) {
    AppendNumber(number, json);
  } else {
    json += "null";
  }
}

}  // namespace plumb
