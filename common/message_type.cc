#include "common/message_type.h"

#include <lcm/lcm_coretypes.h>

#include <algorithm>
#include <cassert>
#include <cstring>
#include <memory>
#include <stdexcept>

// Made by cmake/LcmTypes.cmake, in order of the names.
struct GeneratedMessageType {
  const char* name;
  const lcm_type_info_t* (*info)(void);
};
extern "C" const GeneratedMessageType* plumb_message_types();

namespace plumb {
namespace {

using Kind = MessageType::Kind;

Kind KindOf(lcm_field_type_t type) {
  switch (type) {
    case LCM_FIELD_INT8_T:
      return Kind::kInt8;
    case LCM_FIELD_INT16_T:
      return Kind::kInt16;
    case LCM_FIELD_INT32_T:
      return Kind::kInt32;
    case LCM_FIELD_INT64_T:
      return Kind::kInt64;
    case LCM_FIELD_BYTE:
      return Kind::kByte;
    case LCM_FIELD_FLOAT:
      return Kind::kFloat;
    case LCM_FIELD_DOUBLE:
      return Kind::kDouble;
    case LCM_FIELD_STRING:
      return Kind::kString;
    case LCM_FIELD_BOOLEAN:
      return Kind::kBoolean;
    case LCM_FIELD_USER_TYPE:
      return Kind::kStruct;
  }
  throw std::logic_error("a field of a kind that LCM does not have");
}

/// Writes a number into a field, if it is one that can count others.
void Mark(const lcm_field_t& field, int number) {
  const auto write = [&](auto value) { std::memcpy(field.data, &value, sizeof value); };
  if (field.num_dim > 0) return;
  if (field.type == LCM_FIELD_INT8_T) write(static_cast<int8_t>(number));
  if (field.type == LCM_FIELD_INT16_T) write(static_cast<int16_t>(number));
  if (field.type == LCM_FIELD_INT32_T) write(static_cast<int32_t>(number));
  if (field.type == LCM_FIELD_INT64_T) write(static_cast<int64_t>(number));
}

class Registry {
 public:
  Registry() {
    const GeneratedMessageType* const generated = plumb_message_types();
    for (const auto* entry = generated; entry->name; ++entry)
      types_.push_back({entry->name, entry->info()->get_hash(), {}});
    for (size_t i = 0; i < types_.size(); ++i) Describe(*generated[i].info(), types_[i]);
    for (MessageType& type : types_) Measure(type, 0);
  }
  const std::vector<MessageType>& types() const { return types_; }

 private:
  /// lcm-gen tells how many elements an array of a given struct has, but not which field says so:
  /// in a struct whose every number is that field's own index, the array's size is its name.
  void Describe(const lcm_type_info_t& info, MessageType& type) {
    const auto content =
        std::make_unique<int64_t[]>(static_cast<size_t>(info.struct_size()) / 8 + 1);
    const auto field = [&](int i) {
      lcm_field_t found{};
      info.get_field(content.get(), i, &found);
      return found;
    };
    const int count = info.num_fields();
    for (int i = 0; i < count; ++i) Mark(field(i), i);
    for (int i = 0; i < count; ++i) {
      const lcm_field_t found = field(i);
      MessageType::Field& added = type.fields.emplace_back();
      added.name = found.name;
      added.kind = KindOf(found.type);
      if (added.kind == Kind::kStruct) added.type = &Named(found.typestr);
      for (int d = 0; d < found.num_dim; ++d) {
        const bool varies = found.dim_is_variable[d] != 0;
        added.dimensions.push_back(
            {varies ? found.dim_size[d] : -1, varies ? 0 : found.dim_size[d]});
      }
    }
  }

  /// With or without its package: all of ours have one package.
  MessageType& Named(std::string_view name) {
    name.remove_prefix(name.find_last_of('.') + 1);
    const auto found = std::ranges::find(types_, name, &MessageType::name);
    if (found == types_.end())
      throw std::logic_error("a field is of a type that is not there: " + std::string(name));
    return *found;
  }

  void Measure(MessageType& type, size_t depth) {
    if (depth > types_.size()) throw std::logic_error(type.name + " is a part of itself");
    if (type.least_size > 0) return;
    size_t size = 0;
    for (const MessageType::Field& field : type.fields) {
      if (field.type) Measure(Named(field.type->name), depth + 1);
      size_t elements = 1;
      for (const auto& dimension : field.dimensions)
        elements *= static_cast<size_t>(dimension.counted_by < 0 ? dimension.size : 0);
      size += elements * LeastSize(field);
    }
    type.least_size = size;
  }

  std::vector<MessageType> types_;
};

const std::vector<MessageType>& Types() {
  static const Registry registry;
  return registry.types();
}

}  // namespace

std::string QualifiedName(const MessageType& type) { return "plumb." + type.name; }

std::span<const MessageType> MessageTypes() { return Types(); }

const MessageType* FindMessageType(std::string_view name) {
  const auto found = std::ranges::find(Types(), name, &MessageType::name);
  return found == Types().end() ? nullptr : &*found;
}

const MessageType* TypeOf(std::span<const uint8_t> message) {
  if (message.size() < sizeof(int64_t)) return nullptr;
  uint64_t fingerprint = 0;
  for (size_t i = 0; i < sizeof fingerprint; ++i) fingerprint = fingerprint << 8 | message[i];
  const auto found =
      std::ranges::find(Types(), static_cast<int64_t>(fingerprint), &MessageType::fingerprint);
  return found == Types().end() ? nullptr : &*found;
}

size_t LeastSize(const MessageType::Field& field) {
  switch (field.kind) {
    case Kind::kInt8:
    case Kind::kByte:
    case Kind::kBoolean:
      return 1;
    case Kind::kInt16:
      return 2;
    case Kind::kInt32:
    case Kind::kFloat:
      return 4;
    case Kind::kInt64:
    case Kind::kDouble:
      return 8;
    case Kind::kString:
      return 5;  // its length and a zero
    case Kind::kStruct:
      assert(field.type);
      return field.type->least_size;
  }
  return 1;
}

}  // namespace plumb
