#include "common/config.h"

#include <sys/stat.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>

namespace plumb {
namespace {

using Catch::Equals;

Config Read(const std::string& text) { return Config::Parse(text, "robot.toml"); }

TEST_CASE("values are read with their type and range") {
  Config config = Read("a = 1.5\nb = 3\nc = true\nd = \"x\"\ne = [1, 2.5]\n[f]\ng = -1\n");
  CHECK(config.Number("a") == 1.5);
  CHECK(config.Number("b") == 3);
  CHECK(config.Integer("b", {0, 10}) == 3);
  CHECK(config.Boolean("c"));
  CHECK(config.String("d") == "x");
  CHECK(config.Numbers("e", 2) == std::vector<double>{1, 2.5});
  CHECK(config.Choice("d", {"w", "x"}) == 1);
  CHECK(config.Number("absent", kFinite, 7) == 7);
  Config sub = config.Table("f");
  CHECK(sub.Number("g") == -1);
  sub.Finish();
  config.Finish();
}

TEST_CASE("every mistake is named with file, line and column") {
  Config config = Read("a = \"1.5\"\nb = -3\nc = 2.5\n[f]\ng = 1\n\n[[h]]\nx = 1\n[[h]]\nx = nan\n");
  CHECK_THROWS_WITH(config.Number("a"), Equals("robot.toml:1:5: a is not a number"));
  CHECK_THROWS_WITH(config.Number("b", kPositive), Equals("robot.toml:2:5: b = -3 is not a positive finite number"));
  CHECK_THROWS_WITH(config.Integer("c", {0, 9}), Equals("robot.toml:3:5: c is not an integer"));
  CHECK_THROWS_WITH(config.Integer("b", {0, 9}), Equals("robot.toml:2:5: b = -3 is not in [0, 9]"));
  CHECK_THROWS_WITH(config.Table("f").Number("z"), Equals("robot.toml:4:1: f.z is missing"));
  CHECK_THROWS_WITH(config.Table("b"), Equals("robot.toml:2:5: b is not a table"));
  CHECK_THROWS_WITH(config.Tables("f"), Catch::Contains("[[f]]"));
  CHECK_THROWS_WITH(config.Tables("h")[1].Number("x"), Equals("robot.toml:10:5: h[1].x = nan is not a finite number"));
  CHECK_THROWS_AS(config.Number("nothing"), ConfigError);
}

TEST_CASE("a key that nobody knows is an error that names the nearest") {
  Config config = Read("gravity = 1\nlenght = 2\n");
  config.Number("gravity");
  config.Number("length", kFinite, 1);
  CHECK_THROWS_WITH(config.Finish(), Equals("robot.toml:2:10: lenght is not a known key; did you mean length?"));
}

TEST_CASE("what is not TOML is located") {
  CHECK_THROWS_WITH(Read("a = 1\nb = = 2\n"), Catch::StartsWith("robot.toml:2:5: "));
  CHECK_THROWS_WITH(Config::Load("/nowhere/robot.toml"), Equals("/nowhere/robot.toml: cannot be opened"));
}

TEST_CASE("what is no file of text is refused, however long") {
  namespace fs = std::filesystem;
  CHECK_THROWS_WITH(ReadFile("/"), Equals("/: is a folder"));
  CHECK_THROWS_WITH(ReadFile("/dev/zero"), Equals("/dev/zero: is not a regular file"));
  const std::string file = (fs::temp_directory_path() / ("plumbline_config_test_" + std::to_string(getpid()))).string();
  REQUIRE(mkfifo(file.c_str(), 0600) == 0);
  CHECK_THROWS_WITH(ReadFile(file), Equals(file + ": is not a regular file"));  // nor does it wait for a writer
  fs::remove(file);
  CHECK_THROWS_WITH(ReadFile(file), Equals(file + ": cannot be opened"));
  std::ofstream(file).close();
  CHECK(ReadFile(file).empty());
  fs::resize_file(file, (size_t{16} << 20) + 1);
  CHECK_THROWS_WITH(ReadFile(file), Equals(file + ": is longer than 16 MB"));
  fs::remove(file);
}

TEST_CASE("a key may hold a table or something else") {
  const Config config = Read("a = 1\nb = {c = 1}\n");
  CHECK_FALSE(config.IsTable("a"));
  CHECK(config.IsTable("b"));
  CHECK_FALSE(config.IsTable("c"));
  config.Finish();
}

TEST_CASE("edit distance") {
  CHECK(EditDistance("kitten", "sitting") == 3);
  CHECK(EditDistance("", "abc") == 3);
  CHECK(EditDistance("abc", "abc") == 0);
}

}  // namespace
}  // namespace plumb
