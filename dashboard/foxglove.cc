#include "dashboard/foxglove.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "common/message_json.h"
#include "common/outside_text.h"
#include "robot/json_text.h"

namespace plumb {
namespace {

using nlohmann::json;

constexpr uint8_t kMessageData = 1, kTime = 2, kServiceRequest = 2,
                  kServiceResponse = 3;  // opcodes
constexpr size_t kMaxEntries = 1000;     // of one message

std::string Quoted(std::string_view text) {
  std::string quoted;
  AppendJsonText(text, quoted);
  return quoted;
}

void PutNumber(uint64_t number, size_t bytes, uint8_t* where) {
  for (size_t i = 0; i < bytes; ++i) where[i] = static_cast<uint8_t>(number >> (8 * i));
}

uint32_t GetNumber(std::span<const uint8_t> bytes) {
  return bytes[0] | bytes[1] << 8 | bytes[2] << 16 | static_cast<uint32_t>(bytes[3]) << 24;
}

uint32_t Number(const json& value, const char* name) {
  if (!value.is_number_unsigned() || value.get<uint64_t>() > UINT32_MAX)
    throw std::runtime_error(fmt::format("{}: must be a whole number below 2^32", name));
  return value.get<uint32_t>();
}

uint32_t Member(const json& object, const char* name) {
  if (!object.is_object() || !object.contains(name))
    throw std::runtime_error(fmt::format("{}: is missing", name));
  return Number(object[name], name);
}

const json& List(const json& message, const char* name) {
  const auto found = message.find(name);
  if (found == message.end() || !found->is_array())
    throw std::runtime_error(fmt::format("{}: must be a list", name));
  if (found->size() > kMaxEntries)
    throw std::runtime_error(fmt::format("{}: has more than {} entries", name, kMaxEntries));
  return *found;
}

}  // namespace

std::string ServerInfoText(std::string_view name, std::string_view session) {
  return fmt::format(R"({{"op":"serverInfo","name":{},"capabilities":["services","time"],)"
                     R"("supportedEncodings":["json"],"metadata":{{}},"sessionId":{}}})",
                     Quoted(name), Quoted(session));
}

std::string AdvertiseText(std::span<const FoxgloveTopic> topics) {
  std::string text;
  for (const FoxgloveTopic& topic : topics) {
    text += fmt::format(
        R"({}{{"id":{},"topic":{},"encoding":"json","schemaName":{},"schemaEncoding":"jsonschema",)"
        R"("schema":{}}})",
        text.empty() ? "" : ",", topic.id, Quoted(topic.name), Quoted(topic.schema_name),
        Quoted(topic.schema));
  }
  return R"({"op":"advertise","channels":[)" + text + "]}";
}

std::string AdvertiseServicesText(std::span<const std::string_view> services) {
  const std::string request = R"({"type":"object","properties":{}})";
  const std::string response =
      R"({"type":"object","properties":{"ok":{"type":"boolean"},"text":{"type":"string"}}})";
  const auto described = [](const char* name, const std::string& schema) {
    return fmt::format(
        R"({{"encoding":"json","schemaName":"{}","schemaEncoding":"jsonschema","schema":{}}})",
        name, Quoted(schema));
  };
  std::string text;
  for (size_t i = 0; i < services.size(); ++i) {
    text += fmt::format(
        R"({}{{"id":{},"name":{},"type":"plumb.wish","requestSchema":{},"responseSchema":{},)"
        R"("request":{},"response":{}}})",
        text.empty() ? "" : ",", i + 1, Quoted(services[i]), Quoted(request), Quoted(response),
        described("plumb.wish", request), described("plumb.answer", response));
  }
  return R"({"op":"advertiseServices","services":[)" + text + "]}";
}

std::string StatusText(int level, std::string_view message) {
  return fmt::format(R"({{"op":"status","level":{},"message":{}}})", level, Quoted(message));
}

std::string ServiceFailureText(uint32_t service, uint32_t call, std::string_view message) {
  return fmt::format(R"({{"op":"serviceCallFailure","serviceId":{},"callId":{},"message":{}}})",
                     service, call, Quoted(message));
}

MessageHead MessageHeadOf(uint32_t subscription, int64_t utime) {
  MessageHead head{kMessageData};
  PutNumber(subscription, 4, &head[1]);
  PutNumber(static_cast<uint64_t>(utime) * 1000, 8, &head[5]);
  return head;
}

std::string TimeFrame(int64_t utime) {
  std::array<uint8_t, 9> frame{kTime};
  PutNumber(static_cast<uint64_t>(utime) * 1000, 8, &frame[1]);
  return {frame.begin(), frame.end()};
}

std::string ServiceResponse(uint32_t service, uint32_t call, std::string_view json_text) {
  constexpr std::string_view kEncoding = "json";
  std::array<uint8_t, 13> head{kServiceResponse};
  PutNumber(service, 4, &head[1]);
  PutNumber(call, 4, &head[5]);
  PutNumber(kEncoding.size(), 4, &head[9]);
  return std::string(head.begin(), head.end()).append(kEncoding).append(json_text);
}

ClientMessage ParseClientText(std::string_view text) {
  const json message = ParseJson(text);
  const auto op = message.is_object() ? message.find("op") : message.end();
  if (!message.is_object() || op == message.end() || !op->is_string())
    throw std::runtime_error("op: must be a text");
  ClientMessage said;
  if (*op == "subscribe") {
    for (const json& one : List(message, "subscriptions"))
      said.subscribe.push_back({Member(one, "id"), Member(one, "channelId")});
  } else if (*op == "unsubscribe") {
    for (const json& one : List(message, "subscriptionIds"))
      said.unsubscribe.push_back(Number(one, "subscriptionIds"));
  } else {
    throw std::runtime_error("op: " + Printable(op->get_ref<const std::string&>().substr(0, 40)) +
                             " is not offered here");
  }
  return said;
}

// Opcode, service, call, length of the encoding's name, its name, what is asked: {} or anything.
ClientMessage ParseClientBinary(std::span<const uint8_t> frame) {
  constexpr size_t kHead = 13;
  if (frame.empty() || frame[0] != kServiceRequest)
    throw std::runtime_error("of binary messages only service requests are offered here");
  if (frame.size() < kHead || GetNumber(frame.subspan(9, 4)) > frame.size() - kHead)
    throw std::runtime_error("a service request is too short");
  ClientMessage said;
  said.call = {GetNumber(frame.subspan(1, 4)), GetNumber(frame.subspan(5, 4))};
  return said;
}

}  // namespace plumb
