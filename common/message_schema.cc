#include "common/message_schema.h"

#include <fmt/format.h>

namespace plumb {
namespace {

using Kind = MessageType::Kind;

std::string Properties(const MessageType& type);

std::string Element(const MessageType::Field& field) {
  switch (field.kind) {
    case Kind::kFloat:
    case Kind::kDouble:
      return R"("type":"number")";
    case Kind::kBoolean:
      return R"("type":"boolean")";
    case Kind::kString:
      return R"("type":"string")";
    case Kind::kStruct:
      return Properties(*field.type);
    default:
      return R"("type":"integer")";
  }
}

std::string Property(const MessageType& type, const MessageType::Field& field) {
  if (field.dimensions.empty()) return fmt::format("{{{}}}", Element(field));
  std::string size;
  for (const auto& [counted_by, count] : field.dimensions) {
    size += counted_by < 0 ? fmt::format("[{}]", count)
                           : fmt::format("[{}]", type.fields[static_cast<size_t>(counted_by)].name);
  }
  if (field.dimensions.size() > 1) size += ", row by row";
  return fmt::format(R"({{"type":"array","description":"{}","items":{{{}}}}})", size,
                     Element(field));
}

std::string Properties(const MessageType& type) {
  std::string properties;
  for (const MessageType::Field& field : type.fields) {
    if (!properties.empty()) properties += ',';
    properties += fmt::format(R"("{}":{})", field.name, Property(type, field));
  }
  return fmt::format(R"("type":"object","properties":{{{}}})", properties);
}

}  // namespace

std::string JsonSchema(const MessageType& type) {
  return fmt::format(
      R"({{"$schema":"https://json-schema.org/draft/2020-12/schema","title":"{}",{}}})",
      QualifiedName(type), Properties(type));
}

}  // namespace plumb
