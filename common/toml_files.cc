#include "common/toml_files.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <set>
#include <system_error>
#include <utility>

#include "common/config.h"

namespace plumb {
namespace {

constexpr int kLongestChain = 8;  // of files that extend each other

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
  const size_t count = base.size();
  std::set<std::string> seen;
  for (toml::node& node : own) {
    const std::optional<std::string> name = NameOf(node);
    size_t i = 0;
    while (i < count && !(name && NameOf(*base.get(i)) == name)) ++i;
    // A name that occurs twice in one file is for the reader to refuse.
    if (i < count && seen.insert(*name).second) {
      Merge(*base.get(i)->as_table(), *node.as_table());
    } else {
      base.push_back(std::move(*node.as_table()));
    }
  }
}

}  // namespace

std::string TomlPlace(const std::string& file, const toml::source_region& source) {
  if (source.begin.line == 0) return file + ": ";
  return fmt::format("{}:{}:{}: ", source.path ? *source.path : file, source.begin.line,
                     source.begin.column);
}

toml::table ParseToml(const std::string& text, const std::string& name) {
  try {
    return toml::parse(text, name);
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
  own.erase("extends");
  Merge(base, own);
  return base;
}

}  // namespace plumb
