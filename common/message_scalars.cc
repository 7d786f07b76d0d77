#include "common/message_scalars.h"

#include <vector>

#include "common/message_walk.h"

namespace plumb {
namespace {

/// Knows where it is: the path, and for each struct and array around it how long the path was
/// before.
class ScalarVisitor : public MessageVisitor {
 public:
  explicit ScalarVisitor(const std::function<void(const std::string&, const Scalar&)>& use)
      : use_(use) {}

 private:
  struct Level {
    size_t path;         // its length
    int64_t index = -1;  // of the element under way; -1: a struct
  };
  void Field(std::string_view name) override {
    path_.resize(levels_.back().path);
    if (!path_.empty()) path_ += '.';
    path_ += name;
  }
  void BeginStruct() override { Begin(-1); }
  void EndStruct() override { levels_.pop_back(); }
  void BeginArray(size_t) override { Begin(0); }
  void EndArray() override { levels_.pop_back(); }
  void Integer(int64_t value) override { Tell(value); }
  void Float(float value) override { Tell(value); }
  void Double(double value) override { Tell(value); }
  void Boolean(bool value) override { Tell(value); }
  void Text(std::string_view value) override { Tell(value); }

  void Tell(const Scalar& value) {
    NextElement();
    use_(path_, value);
  }
  void Begin(int64_t index) {
    NextElement();
    levels_.push_back({path_.size(), index});
  }
  void NextElement() {
    if (levels_.empty() || levels_.back().index < 0) return;
    path_.resize(levels_.back().path);
    path_ += '[' + std::to_string(levels_.back().index++) + ']';
  }

  const std::function<void(const std::string&, const Scalar&)>& use_;
  std::string path_;
  std::vector<Level> levels_;
};

}  // namespace

bool ForEachScalar(const MessageType& type, std::span<const uint8_t> message,
                   const std::function<void(const std::string& path, const Scalar&)>& use) {
  ScalarVisitor visitor(use);
  return WalkMessage(type, message, visitor);
}

}  // namespace plumb
