#include "records/message_table.h"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <string_view>
#include <type_traits>
#include <variant>

#include "common/message_scalars.h"
#include "common/message_walk.h"
#include "common/outside_text.h"

namespace plumb {
namespace {

std::string Cell(const Scalar& scalar) {
  return std::visit(
      [](auto value) -> std::string {
        using Value = decltype(value);
        if constexpr (std::is_same_v<Value, std::string_view>) {
          std::string quoted = "\"";
          for (const char c : Printable(value)) quoted += c == '"' ? "\"\"" : std::string(1, c);
          return quoted + '"';
        } else if constexpr (std::is_same_v<Value, bool>) {
          return value ? "1" : "0";
        } else {
          if (std::is_floating_point_v<Value> && value != value) return "nan";  // of either sign
          return fmt::format("{}", value);
        }
      },
      scalar);
}

}  // namespace

/// A column that an earlier message did not have comes behind the one before it in this message.
bool MessageTable::Measure(std::span<const uint8_t> message) {
  if (!Decodes(type_, message)) return false;
  ++rows_;
  auto next = columns_.begin();
  ForEachScalar(type_, message, [&](const std::string& path, const Scalar&) {
    if (too_wide_) return;
    auto place = places_.find(path);
    if (place == places_.end()) {
      too_wide_ = columns_.size() >= kMostColumns;
      if (too_wide_) return;
      place = places_.emplace(path, columns_.insert(next, path)).first;
    }
    next = std::next(place->second);
  });
  return true;
}

void MessageTable::Open(const std::filesystem::path& file) {
  file_.emplace(file);
  file_->Write("received");
  for (const std::string& column : columns_) {
    numbers_.emplace(column, numbers_.size());
    file_->Write("," + column);
  }
  file_->Write("\n");
  cells_.resize(numbers_.size());
}

void MessageTable::Write(int64_t received, std::span<const uint8_t> message) {
  for (std::string& cell : cells_) cell.clear();
  const auto fill = [&](const std::string& path, const Scalar& scalar) {
    const auto number = numbers_.find(path);
    if (number != numbers_.end()) cells_[number->second] = Cell(scalar);
  };
  if (!ForEachScalar(type_, message, fill)) return;
  file_->Write(std::to_string(received));
  for (const std::string& cell : cells_) {
    file_->Write(",");
    file_->Write(cell);
  }
  file_->Write("\n");
}

void MessageTable::Finish() { file_->Commit(); }

}  // namespace plumb
