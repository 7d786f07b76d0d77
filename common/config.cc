#include "common/config.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <tuple>

#include "common/nearest_name.h"
#include "common/outside_text.h"
#include "common/toml_files.h"

namespace plumb {
namespace {

std::string Describe(Range range) {
  const auto bounded = [](double x) { return std::abs(x) < std::numeric_limits<double>::max(); };
  if (range.lower == std::numeric_limits<double>::min()) return "a positive finite number";
  if (range.lower == 0 && !bounded(range.upper)) return "a finite number not below 0";
  if (bounded(range.lower) && bounded(range.upper))
    return fmt::format("in [{}, {}]", range.lower, range.upper);
  if (bounded(range.lower)) return fmt::format("a finite number not below {}", range.lower);
  if (bounded(range.upper)) return fmt::format("a finite number not above {}", range.upper);
  return "a finite number";
}

bool Inside(double value, Range range) { return value >= range.lower && value <= range.upper; }

}  // namespace

ConfigError::ConfigError(const std::string& message) : std::runtime_error(Printable(message)) {}

std::string ReadFile(const std::string& file) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(file, error);
  if (std::filesystem::is_directory(status)) throw ConfigError(file + ": is a folder");
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    // opening a pipe would wait for who writes to it
    throw ConfigError(file + ": is not a regular file");
  }
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw ConfigError(file + ": cannot be opened");
  std::string text, piece(size_t{1} << 16, '\0');
  do {
    stream.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    text.append(piece, 0, static_cast<size_t>(stream.gcount()));
    if (text.size() > size_t{16} << 20) throw ConfigError(file + ": is longer than 16 MB");
  } while (stream);
  if (stream.bad()) throw ConfigError(file + ": cannot be read");
  return text;
}

std::string MergedToml(const std::string& file, const std::string& table, const std::string& key,
                       const std::string& text) {
  std::vector<std::string> chain;
  toml::table root = LoadTomlChain(file, chain);
  if (toml::table* const inner = root[table].as_table()) {
    if (toml::value<std::string>* const value = inner->get_as<std::string>(key)) *value = text;
  }
  std::ostringstream stream;
  // Plain: no form that older readers do not know.
  stream << toml::toml_formatter(root, toml::format_flags::none) << '\n';
  return stream.str();
}

Config::Config(std::shared_ptr<const toml::table> root, const toml::table* table, std::string file,
               std::string path)
    : root_(std::move(root)), table_(table), file_(std::move(file)), path_(std::move(path)) {}
Config::Config(Config&&) noexcept = default;
Config& Config::operator=(Config&&) noexcept = default;
Config::~Config() = default;

Config Config::Parse(const std::string& text, const std::string& name) {
  auto root = std::make_shared<const toml::table>(ParseToml(text, name));
  const toml::table* table = root.get();
  return Config(std::move(root), table, name, "");
}

Config Config::Load(const std::string& file, std::vector<std::string>* files) {
  std::vector<std::string> chain;
  auto root = std::make_shared<const toml::table>(LoadTomlChain(file, chain));
  if (files) files->insert(files->end(), chain.begin(), chain.end());
  const toml::table* table = root.get();
  return Config(std::move(root), table, file, "");
}

bool Config::Has(const std::string& key) const {
  known_.insert(key);
  return table().contains(key);
}

bool Config::IsTable(const std::string& key) const {
  return Has(key) && table().get(key)->is_table();
}

std::string Config::FileOf(const std::string& key) const {
  const toml::node* node = table().get(key);
  return node && node->source().path ? *node->source().path : file_;
}

std::string Config::Position(const std::string& key) const {
  const toml::node* node = table().get(key);
  return TomlPlace(file_, node ? node->source() : table().source());
}

void Config::Fail(const std::string& key, const std::string& what) const {
  const std::string full = path_.empty() ? key : path_ + "." + key;
  throw ConfigError(fmt::format("{}{} {}", Position(key), full, what));
}

void Config::FailMissing(const std::string& key) const {
  FailMisspelt(key);
  Fail(key, "is missing");
}

void Config::FailMisspelt(const std::string& key) const {
  for (const std::string& present : Keys()) {
    if (known_.count(present) == 0 &&
        EditDistance(present, key) <= std::min<size_t>(2, key.size() / 2)) {
      Fail(present, "is not a known key; did you mean " + key + "?");
    }
  }
}

namespace {

// A whole number beyond 2^53 is rounded, too: toml++ has no double of one.
double NumberOf(const toml::node& node) {
  if (const auto* whole = node.as_integer()) return static_cast<double>(whole->get());
  return node.as_floating_point()->get();
}

}  // namespace

double Config::Number(const std::string& key, Range range, std::optional<double> fallback) {
  if (!Has(key)) {
    if (fallback) return *fallback;
    FailMissing(key);
  }
  const toml::node* node = table().get(key);
  if (!node->is_number()) Fail(key, "is not a number");
  const double value = NumberOf(*node);
  if (!Inside(value, range)) Fail(key, fmt::format("= {} is not {}", value, Describe(range)));
  return value;
}

int Config::Integer(const std::string& key, Range range, std::optional<int> fallback) {
  if (!Has(key)) {
    if (fallback) return *fallback;
    FailMissing(key);
  }
  const toml::node* node = table().get(key);
  if (!node->is_integer()) Fail(key, "is not an integer");
  const int64_t value = *node->value<int64_t>();
  range.lower = std::max(range.lower, -2147483648.0);
  range.upper = std::min(range.upper, 2147483647.0);
  if (!Inside(static_cast<double>(value), range))
    Fail(key, fmt::format("= {} is not {}", value, Describe(range)));
  return static_cast<int>(value);
}

bool Config::Boolean(const std::string& key, std::optional<bool> fallback) {
  if (!Has(key)) {
    if (fallback) return *fallback;
    FailMissing(key);
  }
  const toml::node* node = table().get(key);
  if (!node->is_boolean()) Fail(key, "is not true or false");
  return *node->value<bool>();
}

std::string Config::String(const std::string& key, std::optional<std::string> fallback) {
  if (!Has(key)) {
    if (fallback) return *fallback;
    FailMissing(key);
  }
  const toml::node* node = table().get(key);
  if (!node->is_string()) Fail(key, "is not a string");
  std::string text = *node->value<std::string>();
  if (text != Printable(text)) Fail(key, "contains what cannot be printed");
  return text;
}

int Config::Choice(const std::string& key, const std::vector<std::string>& choices,
                   std::optional<int> fallback) {
  if (!Has(key) && fallback) return *fallback;
  const std::string value = String(key);
  const auto found = std::find(choices.begin(), choices.end(), value);
  if (found == choices.end())
    Fail(key, fmt::format("= \"{}\" is not one of {}", value, fmt::join(choices, ", ")));
  return static_cast<int>(found - choices.begin());
}

std::vector<double> Config::Numbers(const std::string& key, size_t size, Range range,
                                    std::optional<std::vector<double>> fallback) {
  if (!Has(key)) {
    if (fallback) return *fallback;
    FailMissing(key);
  }
  const toml::array* array = table().get(key)->as_array();
  if (!array) Fail(key, "is not an array of numbers");
  std::vector<double> values;
  for (const toml::node& node : *array) {
    if (!node.is_number()) Fail(key, "is not an array of numbers");
    values.push_back(NumberOf(node));
    if (!Inside(values.back(), range))
      Fail(key, fmt::format("contains {}, not {}", values.back(), Describe(range)));
  }
  if (size != 0 && values.size() != size)
    Fail(key, fmt::format("has {} numbers, not {}", values.size(), size));
  return values;
}

std::vector<int> Config::Integers(const std::string& key, Range range,
                                  std::optional<std::vector<int>> fallback) {
  if (!Has(key) && fallback) return *fallback;
  std::vector<int> values;
  for (const double number : Numbers(key, 0, range)) {
    if (number != std::floor(number) || std::abs(number) > 2147483647)
      Fail(key, "is not an array of integers");
    values.push_back(static_cast<int>(number));
  }
  return values;
}

std::vector<std::string> Config::Strings(const std::string& key,
                                         std::optional<std::vector<std::string>> fallback) {
  if (!Has(key)) {
    if (fallback) return *fallback;
    FailMissing(key);
  }
  const toml::array* array = table().get(key)->as_array();
  std::vector<std::string> values;
  if (array) {
    for (const toml::node& node : *array) {
      if (const auto text = node.value_exact<std::string>()) values.push_back(*text);
    }
  }
  if (!array || values.size() != array->size()) Fail(key, "is not an array of texts");
  return values;
}

Config Config::Table(const std::string& key, bool required) {
  static const toml::table empty;
  const std::string path = path_.empty() ? key : path_ + "." + key;
  if (!Has(key)) {
    if (required) FailMissing(key);
    return Config(root_, &empty, file_, path);
  }
  const toml::table* sub = table().get(key)->as_table();
  if (!sub) Fail(key, "is not a table");
  return Config(root_, sub, file_, path);
}

std::vector<Config> Config::Tables(const std::string& key) {
  std::vector<Config> tables;
  if (!Has(key)) {
    FailMisspelt(key);
    return tables;
  }
  const toml::array* array = table().get(key)->as_array();
  if (!array || !array->is_homogeneous<toml::table>())
    Fail(key, "is not an array of tables: write [[" + key + "]]");
  for (const toml::node& node : *array) {
    tables.push_back(
        Config(root_, node.as_table(), file_,
               fmt::format("{}{}[{}]", path_.empty() ? "" : path_ + ".", key, tables.size())));
  }
  return tables;
}

std::vector<std::string> Config::Keys() const {
  // The file's own keys come after those of the file that it extends.
  std::vector<std::tuple<bool, toml::source_position, std::string>> keys;
  for (const auto& [key, node] : table()) {
    const toml::source_region& source = node.source();
    keys.emplace_back(!source.path || *source.path == file_, source.begin, key.str());
  }
  std::sort(keys.begin(), keys.end());
  std::vector<std::string> names;
  names.reserve(keys.size());
  for (auto& [own, position, name] : keys) names.push_back(std::move(name));
  return names;
}

void Config::Finish() const {
  for (const std::string& key : Keys()) {
    if (known_.count(key) != 0) continue;
    const std::vector<std::string> known(known_.begin(), known_.end());
    Fail(key, "is not a known key" +
                  (known.empty() ? "" : "; did you mean " + NearestName(key, known) + "?"));
  }
}

}  // namespace plumb
