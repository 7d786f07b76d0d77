#include "common/toml_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/config.h"

namespace plumb {
namespace {

constexpr int kLongestChain = 8;  // of files that extend each other
// Far beyond any robot; what has more keeps the reader busy for minutes, or ends it by recursion.
constexpr int kDeepestKey = 16;                              // parts of a.b.c
constexpr size_t kMostEntries = 10'000;                      // of a table or an array
constexpr size_t kMostTakenAway = 200;                       // by `without`, each looked for in all
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";  // which a file may begin with

// What the reader must not be given. It makes a table of each part of a dotted key, and descends
// into them by recursion; and of letters outside ASCII, which TOML has in strings and comments
// only, toml++ 3.3 asks what it then holds to be impossible (is_non_ascii_horizontal_whitespace).
// Strings and comments are passed over: their dots are none.
void RequirePlainKeys(const std::string& text, const std::string& name) {
  size_t line = 1;
  int parts = 1;
  const auto pass = [&](size_t& at, std::string_view end, bool escapes) {
    for (; at < text.size() && text.compare(at, end.size(), end) != 0; ++at) {
      if (text[at] == '\n' && end.size() == 1) return;  // a string that has no end
      line += text[at] == '\n';
      if (escapes && text[at] == '\\') ++at;
    }
    at += end.size() - 1;
    // Of four or five quotes that end a string of many lines the last three do.
    const auto quote_follows = [&] { return at + 1 < text.size() && text[at + 1] == end[0]; };
    for (int more = 0; end.size() == 3 && more < 2 && quote_follows(); ++more) ++at;
  };
  for (size_t at = text.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0; at < text.size();
       ++at) {
    const char c = text[at];
    if (static_cast<unsigned char>(c) > 127) {
      throw ConfigError(
          fmt::format("{}:{}: a character outside ASCII, and not within quotes", name, line));
    } else if (c == '"' || c == '\'') {
      const std::string triple(3, c);
      const bool many_lines = text.compare(at, 3, triple) == 0;
      at += many_lines ? 3 : 1;
      pass(at, many_lines ? triple : std::string(1, c), c == '"');
    } else if (c == '#') {
      at = std::min(text.find('\n', at), text.size()) - 1;
    } else if (c == '.') {
      if (++parts > kDeepestKey) {
        throw ConfigError(
            fmt::format("{}:{}: a key of more than {} parts", name, line, kDeepestKey));
      }
    } else if (std::string_view("=,[]{}\n").find(c) != std::string_view::npos) {
      parts = 1;
      line += c == '\n';
    }
  }
}

// The text with an x for each character outside ASCII, so that places in it stay what they are.
std::string InAscii(std::string_view text) {
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  std::string ascii;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool continues = byte >= 0x80 && byte < 0xC0;  // a character's second byte, or later
    if (!continues) ascii += byte < 0x80 ? c : 'x';
  }
  return ascii;
}

bool IsAscii(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return (c & 0x80) == 0; });
}

void RequireModest(const toml::node& node, const std::string& name) {
  const auto require = [&](size_t entries) {
    if (entries <= kMostEntries) return;
    throw ConfigError(fmt::format("{}{} entries, more than {}", TomlPlace(name, node.source()),
                                  entries, kMostEntries));
  };
  if (const toml::table* table = node.as_table()) {
    require(table->size());
    for (auto&& [key, entry] : *table) RequireModest(entry, name);
  } else if (const toml::array* array = node.as_array()) {
    require(array->size());
    for (const toml::node& entry : *array) RequireModest(entry, name);
  }
}

bool IsTables(const toml::node& node) {
  return node.is_array() && !node.as_array()->empty() &&
         node.as_array()->is_homogeneous<toml::table>();
}

std::optional<std::string> NameOf(const toml::node& node) {
  return (*node.as_table())["name"].value<std::string>();
}

void MergeByName(toml::array& base, toml::array& own);

// Nodes are moved: a copy forgets where it comes from.
void Merge(toml::table& base, toml::table& own) {
  for (auto&& [key, node] : own) {
    toml::node* known = base.get(key);
    if (known && known->is_table() && node.is_table()) {
      Merge(*known->as_table(), *node.as_table());
    } else if (known && IsTables(*known) && IsTables(node)) {
      MergeByName(*known->as_array(), *node.as_array());
    } else {
      base.insert_or_assign(key, std::move(node));
    }
  }
}

void MergeByName(toml::array& base, toml::array& own) {
  std::map<std::string, size_t> places;  // where the name is first
  for (size_t i = 0; i < base.size(); ++i) {
    if (const auto name = NameOf(*base.get(i))) places.emplace(*name, i);
  }
  std::set<std::string> seen;
  for (toml::node& node : own) {
    const std::optional<std::string> name = NameOf(node);
    const auto place = name ? places.find(*name) : places.end();
    // A name that occurs twice in one file is for the reader to refuse.
    if (place != places.end() && seen.insert(*name).second) {
      Merge(*base.get(place->second)->as_table(), *node.as_table());
    } else {
      base.push_back(std::move(*node.as_table()));
    }
  }
}

bool EraseByName(toml::array& tables, const std::string& name) {
  const size_t before = tables.size();
  for (auto table = tables.begin(); table != tables.end();)
    table = NameOf(*table) == name ? tables.erase(table) : std::next(table);
  return tables.size() < before;
}

// "task/velocity" of tables, "parameter/mass/trunk" of arrays of tables with names.
bool Erase(toml::table& from, const std::string& path) {
  if (from.erase(path) > 0) return true;
  const size_t slash = path.find('/');
  const std::string key = path.substr(0, slash);
  toml::node* const node = from.get(key);
  if (!node || slash == std::string::npos) return false;
  const std::string rest = path.substr(slash + 1);
  if (node->is_table()) return Erase(*node->as_table(), rest);
  if (!IsTables(*node) || !EraseByName(*node->as_array(), rest)) return false;
  if (node->as_array()->empty()) from.erase(key);
  return true;
}

// What the extending file says it is without.
void TakeAway(const toml::node& without, const std::string& file, toml::table& base) {
  const auto fail = [&](const toml::node& where, const std::string& what) {
    throw ConfigError(TomlPlace(file, where.source()) + what);
  };
  if (!without.is_array()) fail(without, "without is not an array of texts");
  if (without.as_array()->size() > kMostTakenAway)
    fail(without, fmt::format("without more than {} entries of a file", kMostTakenAway));
  for (const toml::node& entry : *without.as_array()) {
    const auto path = entry.value_exact<std::string>();
    if (!path) fail(entry, "without is not an array of texts");
    if (!Erase(base, *path))
      fail(entry, fmt::format("without \"{}\": the file that is extended has none", *path));
  }
}

}  // namespace

std::string TomlPlace(const std::string& file, const toml::source_region& source) {
  if (source.begin.line == 0) return file + ": ";
  return fmt::format("{}:{}:{}: ", source.path ? *source.path : file, source.begin.line,
                     source.begin.column);
}

toml::table ParseToml(const std::string& text, const std::string& name) {
  RequirePlainKeys(text, name);
  try {
    // Where quotes begin and end is known of what is TOML. Else one may open no string, and toml++
    // would meet the letters behind it.
    if (!IsAscii(text)) (void)toml::parse(InAscii(text), name);
    toml::table table = toml::parse(text, name);
    RequireModest(table, name);
    return table;
  } catch (const toml::parse_error& error) {
    throw ConfigError(TomlPlace(name, error.source()) + std::string(error.description()));
  }
}

toml::table LoadTomlChain(const std::string& file, std::vector<std::string>& files) {
  files.push_back(file);
  toml::table own = ParseToml(ReadFile(file), file);
  const toml::node* extends = own.get("extends");
  if (!extends) return own;
  const std::string at = TomlPlace(file, extends->source());
  if (!extends->is_string()) throw ConfigError(at + "extends is not a string");
  if (files.size() > kLongestChain)
    throw ConfigError(at + "extends a file that extends a file ... and so on, without end");
  const std::filesystem::path base_file =
      std::filesystem::path(file).parent_path() / *extends->value<std::string>();
  std::error_code error;
  if (!std::filesystem::exists(base_file, error)) {
    throw ConfigError(fmt::format("{}extends = \"{}\": there is no such file", at,
                                  *extends->value<std::string>()));
  }
  toml::table base = LoadTomlChain(base_file.string(), files);
  if (const toml::node* without = own.get("without")) TakeAway(*without, file, base);
  own.erase("extends"), own.erase("without");
  Merge(base, own);
  return base;
}

}  // namespace plumb
