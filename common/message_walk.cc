#include "common/message_walk.h"

#include <algorithm>
#include <bit>
#include <type_traits>
#include <vector>

#include "common/seal.h"

namespace plumb {
namespace {

using Kind = MessageType::Kind;

class Walk {
 public:
  Walk(std::span<const uint8_t> bytes, MessageVisitor& visitor) : rest_(bytes), visitor_(visitor) {}

  std::span<const uint8_t> rest() const { return rest_; }

  bool Struct(const MessageType& type) {
    visitor_.BeginStruct();
    std::vector<int64_t> numbers;  // of the fields so far, those that may count others
    numbers.reserve(type.fields.size());
    for (const MessageType::Field& field : type.fields) {
      visitor_.Field(field.name);
      numbers.push_back(0);
      if (field.dimensions.empty() ? !Value(field, &numbers.back()) : !Array(field, numbers))
        return false;
    }
    visitor_.EndStruct();
    return true;
  }

 private:
  bool Array(const MessageType::Field& field, const std::vector<int64_t>& numbers) {
    // No more than the bytes that are left, or one more than these: the product does not overflow.
    const int64_t most = static_cast<int64_t>(rest_.size()) + 1;
    int64_t elements = 1;
    for (const auto& [counted_by, size] : field.dimensions) {
      const int64_t count = counted_by < 0 ? size : numbers[static_cast<size_t>(counted_by)];
      if (count < 0) return false;
      elements = std::min(elements * std::min(count, most), most);
      if (elements == 0) break;
    }
    if (static_cast<size_t>(elements) > rest_.size() / LeastSize(field)) return false;
    visitor_.BeginArray(static_cast<size_t>(elements));
    for (int64_t i = 0; i < elements; ++i) {
      int64_t ignored = 0;
      if (!Value(field, &ignored)) return false;
    }
    visitor_.EndArray();
    return true;
  }

  /// @param number becomes the value if it is an integer.
  bool Value(const MessageType::Field& field, int64_t* number) {
    switch (field.kind) {
      case Kind::kInt8:
        return Integer<int8_t>(number);
      case Kind::kInt16:
        return Integer<int16_t>(number);
      case Kind::kInt32:
        return Integer<int32_t>(number);
      case Kind::kInt64:
        return Integer<int64_t>(number);
      case Kind::kByte:
        return Integer<uint8_t>(number);
      case Kind::kFloat:
        return Take<uint32_t>([&](uint32_t v) { visitor_.Float(std::bit_cast<float>(v)); });
      case Kind::kDouble:
        return Take<uint64_t>([&](uint64_t v) { visitor_.Double(std::bit_cast<double>(v)); });
      case Kind::kBoolean:
        return Take<uint8_t>([&](uint8_t v) { visitor_.Boolean(v != 0); });
      case Kind::kString:
        return String();
      case Kind::kStruct:
        return Struct(*field.type);
    }
    return false;
  }

  template <class T>
  bool Integer(int64_t* number) {
    return Take<std::make_unsigned_t<T>>([&](uint64_t bits) {
      constexpr int kUnused = std::is_signed_v<T> ? 64 - 8 * sizeof(T) : 0;
      *number = static_cast<int64_t>(bits << kUnused) >> kUnused;  // its first bit is the sign
      visitor_.Integer(*number);
    });
  }

  bool String() {
    int32_t length = 0;  // with the zero at its end
    if (!Take<uint32_t>([&](uint32_t bits) { length = static_cast<int32_t>(bits); })) return false;
    if (length < 1 || static_cast<size_t>(length) > rest_.size()) return false;
    visitor_.Text({reinterpret_cast<const char*>(rest_.data()), static_cast<size_t>(length) - 1});
    rest_ = rest_.subspan(static_cast<size_t>(length));
    return true;
  }

  /// Numbers are big-endian.
  template <class Bits, class Use>
  bool Take(Use use) {
    if (rest_.size() < sizeof(Bits)) return false;
    uint64_t bits = 0;
    for (size_t i = 0; i < sizeof(Bits); ++i) bits = bits << 8 | rest_[i];
    rest_ = rest_.subspan(sizeof(Bits));
    use(static_cast<Bits>(bits));
    return true;
  }

  std::span<const uint8_t> rest_;
  MessageVisitor& visitor_;
};

bool IsSeal(std::span<const uint8_t> bytes) { return bytes.size() == kSealSize && FindSeal(bytes); }

class Nobody : public MessageVisitor {
  void Field(std::string_view) override {}
  void BeginStruct() override {}
  void EndStruct() override {}
  void BeginArray(size_t) override {}
  void EndArray() override {}
  void Integer(int64_t) override {}
  void Float(float) override {}
  void Double(double) override {}
  void Boolean(bool) override {}
  void Text(std::string_view) override {}
};

}  // namespace

bool WalkMessage(const MessageType& type, std::span<const uint8_t> message,
                 MessageVisitor& visitor) {
  if (TypeOf(message) != &type) return false;
  Walk walk(message.subspan(sizeof(type.fingerprint)), visitor);
  // Where the message ends, it says itself: its last bytes may look like a seal.
  return walk.Struct(type) && (walk.rest().empty() || IsSeal(walk.rest()));
}

bool Decodes(const MessageType& type, std::span<const uint8_t> message) {
  Nobody nobody;
  return WalkMessage(type, message, nobody);
}

}  // namespace plumb
