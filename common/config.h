#pragma once

#include <functional>
#include <initializer_list>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace toml {
inline namespace v3 {
class table;
}
}  // namespace toml

namespace plumb {

/// A configuration file that cannot be used. The message begins with "file:line:column: ", and is
/// one line whatever it quotes of the file.
struct ConfigError : std::runtime_error {
  explicit ConfigError(const std::string& message);
};

/// Closed interval a number must lie in.
struct Range {
  double lower = -std::numeric_limits<double>::infinity();
  double upper = std::numeric_limits<double>::infinity();
};
inline constexpr Range kPositive{std::numeric_limits<double>::min(),
                                 std::numeric_limits<double>::max()};
inline constexpr Range kNotNegative{0, std::numeric_limits<double>::max()};
inline constexpr Range kFinite{std::numeric_limits<double>::lowest(),
                               std::numeric_limits<double>::max()};

/// One table of a TOML file, read strictly: every value has a type and a range, and every key that
/// nobody asked for is an error that names the nearest known one. All errors are ConfigErrors with
/// file, line and column. Not thread-safe.
class Config {
 public:
  /// Reads a file, and the one that its key `extends` names, relative to its folder: what the file
  /// says stands in place of what that one says; tables are merged, and of arrays of tables those
  /// with the same `name`. Its key `without` lists what it has not of the other one: keys of
  /// tables and named tables of arrays, ["task/velocity", "sensor/imu"].
  /// @throws ConfigError if one cannot be opened or parsed, or they extend each other.
  /// @param files if not null, those that were read are appended to it, this one first.
  static Config Load(const std::string& file, std::vector<std::string>* files = nullptr);
  /// Reads text, for tests; `name` stands for the file.
  static Config Parse(const std::string& text, const std::string& name);

  Config(Config&&) noexcept;
  Config& operator=(Config&&) noexcept;
  ~Config();

  const std::string& file() const { return file_; }
  bool Has(const std::string& key) const;
  /// A key that may hold a table or something else.
  bool IsTable(const std::string& key) const;

  /// Values; without `fallback` the key is required. @throws ConfigError naming the key's place, if
  /// it is missing, of another type or out of range.
  double Number(const std::string& key, Range range = kFinite, std::optional<double> fallback = {});
  int Integer(const std::string& key, Range range, std::optional<int> fallback = {});
  bool Boolean(const std::string& key, std::optional<bool> fallback = {});
  std::string String(const std::string& key, std::optional<std::string> fallback = {});
  /// One of the choices. @return its index.
  int Choice(const std::string& key, const std::vector<std::string>& choices,
             std::optional<int> fallback = {});
  /// Array of numbers; `size` 0 = any length.
  std::vector<double> Numbers(const std::string& key, size_t size, Range range = kFinite,
                              std::optional<std::vector<double>> fallback = {});
  std::vector<int> Integers(const std::string& key, Range range,
                            std::optional<std::vector<int>> fallback = {});
  /// Array of texts.
  std::vector<std::string> Strings(const std::string& key,
                                   std::optional<std::vector<std::string>> fallback = {});

  /// A sub-table `[key]`; empty if absent and not required.
  Config Table(const std::string& key, bool required = true);
  /// An array of tables `[[key]]`, possibly empty.
  std::vector<Config> Tables(const std::string& key);
  /// Keys of this table in the file's order; marks none of them as read.
  std::vector<std::string> Keys() const;

  /// Call when everything has been read: the first key nobody read is an error.
  void Finish() const;
  /// The file that says what `key` is: this one, or one that it extends.
  std::string FileOf(const std::string& key) const;
  /// "file:line:column: " of `key` (or of the table, if it has no such key).
  std::string Position(const std::string& key) const;
  /// An error at the position of `key` (or of the table, if it has no such key).
  [[noreturn]] void Fail(const std::string& key, const std::string& what) const;

 private:
  Config(std::shared_ptr<const toml::table> root, const toml::table* table, std::string file,
         std::string path);
  const toml::table& table() const { return *table_; }
  [[noreturn]] void FailMissing(const std::string& key) const;
  /// What is not there has usually been misspelt: then its line is the place to point to.
  void FailMisspelt(const std::string& key) const;

  std::shared_ptr<const toml::table> root_;
  const toml::table* table_;
  std::string file_;
  std::string path_;
  mutable std::set<std::string> known_;
};

/// A file with all that it extends merged in, as TOML text that reads back to the same values and
/// extends nothing. Comments are lost.
/// @param table, key, text a string in it that is to be another one, e.g. a file's new name.
/// @throws ConfigError as Config::Load does.
std::string MergedToml(const std::string& file, const std::string& table, const std::string& key,
                       const std::string& text);

/// The bytes of a regular file. @throws ConfigError if it is none, cannot be read or is longer than
/// 16 MB.
std::string ReadFile(const std::string& file);

}  // namespace plumb
