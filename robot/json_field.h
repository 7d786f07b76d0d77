#pragma once

#include <fmt/format.h>

#include <Eigen/Core>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace plumb {

/// A value of a JSON file, and the way to it for complaints. The JSON must outlive it. Everything
/// throws std::runtime_error "mixture.means[0][1]: is not a number". Immutable: thread-safe.
class JsonField {
 public:
  JsonField(const nlohmann::json& value, std::string path)
      : value_(value), path_(std::move(path)) {}

  [[noreturn]] void Fail(const std::string& what) const {
    throw std::runtime_error(path_ + ": " + what);
  }
  void Require(bool holds, const std::string& what) const {
    if (!holds) Fail(what);
  }

  JsonField operator[](const char* key) const {
    Require(value_.is_object(), "is not an object");
    const auto found = value_.find(key);
    const std::string path = path_.empty() ? key : path_ + "." + key;
    if (found == value_.end()) JsonField(value_, path).Fail("is missing");
    return {*found, path};
  }
  /// The entries of an array of `size`.
  std::vector<JsonField> Entries(size_t size) const {
    Require(value_.is_array(), "is not an array");
    Require(value_.size() == size, fmt::format("has {} entries, expected {}", value_.size(), size));
    std::vector<JsonField> entries;
    for (size_t i = 0; i < size; ++i)
      entries.emplace_back(value_[i], fmt::format("{}[{}]", path_, i));
    return entries;
  }
  bool null() const { return value_.is_null(); }
  size_t size() const {
    Require(value_.is_array(), "is not an array");
    return value_.size();
  }
  double Number() const {
    Require(value_.is_number(), "is not a number");
    const auto number = value_.get<double>();
    Require(std::isfinite(number), "is not finite");
    return number;
  }
  std::string Text() const {
    Require(value_.is_string(), "is not a string");
    return value_.get<std::string>();
  }
  void RequireText(const std::string& expected, const std::string& otherwise) const {
    Require(Text() == expected, fmt::format("{}: it is \"{}\", expected \"{}\"", otherwise,
                                            Text().substr(0, 80), expected));
  }
  Eigen::VectorXd Vector(size_t size) const {
    Eigen::VectorXd vector(size);
    Eigen::Index i = 0;
    for (const JsonField& entry : Entries(size)) vector(i++) = entry.Number();
    return vector;
  }
  Eigen::MatrixXd Matrix(size_t size) const {
    const std::vector<JsonField> rows = Entries(size);
    Eigen::MatrixXd matrix(size, size);
    for (size_t i = 0; i < size; ++i)
      matrix.row(static_cast<Eigen::Index>(i)) = rows[i].Vector(size);
    return matrix;
  }

  // Of numbers that single precision has, written as short as it allows:
  double Single() const {
    const auto number = static_cast<double>(static_cast<float>(Number()));
    Require(std::isfinite(number), "is not finite in single precision");
    return number;
  }
  Eigen::VectorXd SingleVector(size_t size) const {
    Eigen::VectorXd vector(size);
    Eigen::Index i = 0;
    for (const JsonField& entry : Entries(size)) vector(i++) = entry.Single();
    return vector;
  }
  Eigen::MatrixXd SingleMatrix(size_t rows, size_t columns) const {
    Eigen::MatrixXd matrix(rows, columns);
    Eigen::Index i = 0;
    for (const JsonField& row : Entries(rows)) matrix.row(i++) = row.SingleVector(columns);
    return matrix;
  }

 private:
  const nlohmann::json& value_;
  std::string path_;
};

}  // namespace plumb
