#include "common/config.h"

#include <sys/stat.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>

#include "tests/temporary_folder.h"

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

TEST_CASE("a whole number that no double has is rounded, and has its range") {
  Config config = Read("a = 9007199254740993\nb = [9223372036854775807]\n");
  CHECK(config.Number("a") == 9007199254740992);
  CHECK(config.Numbers("b", 1)[0] == 9223372036854775807.0);
  CHECK_THROWS_WITH(config.Number("a", {1e-3, 10}), Catch::Contains("is not in"));
  CHECK_THROWS_WITH(config.Numbers("b", 1, {1e-3, 10}), Catch::Contains("not in"));
}

TEST_CASE("every mistake is named with file, line and column") {
  Config config =
      Read("a = \"1.5\"\nb = -3\nc = 2.5\n[f]\ng = 1\n\n[[h]]\nx = 1\n[[h]]\nx = nan\n");
  CHECK_THROWS_WITH(config.Number("a"), Equals("robot.toml:1:5: a is not a number"));
  CHECK_THROWS_WITH(config.Number("b", kPositive),
                    Equals("robot.toml:2:5: b = -3 is not a positive finite number"));
  CHECK_THROWS_WITH(config.Integer("c", {0, 9}), Equals("robot.toml:3:5: c is not an integer"));
  CHECK_THROWS_WITH(config.Integer("b", {0, 9}), Equals("robot.toml:2:5: b = -3 is not in [0, 9]"));
  CHECK_THROWS_WITH(config.Table("f").Number("z"), Equals("robot.toml:4:1: f.z is missing"));
  CHECK_THROWS_WITH(config.Table("b"), Equals("robot.toml:2:5: b is not a table"));
  CHECK_THROWS_WITH(config.Tables("f"), Catch::Contains("[[f]]"));
  CHECK_THROWS_WITH(config.Tables("h")[1].Number("x"),
                    Equals("robot.toml:10:5: h[1].x = nan is not a finite number"));
  CHECK_THROWS_AS(config.Number("nothing"), ConfigError);
}

TEST_CASE("a key that nobody knows is an error that names the nearest") {
  Config config = Read("gravity = 1\nlenght = 2\n");
  config.Number("gravity");
  config.Number("length", kFinite, 1);
  CHECK_THROWS_WITH(config.Finish(),
                    Equals("robot.toml:2:10: lenght is not a known key; did you mean length?"));
}

TEST_CASE("what is not TOML is located") {
  CHECK_THROWS_WITH(Read("a = 1\nb = = 2\n"), Catch::StartsWith("robot.toml:2:5: "));
  CHECK_THROWS_WITH(Config::Load("/nowhere/robot.toml"),
                    Equals("/nowhere/robot.toml: cannot be opened"));
}

TEST_CASE("what is no file of text is refused, however long") {
  namespace fs = std::filesystem;
  CHECK_THROWS_WITH(ReadFile("/"), Equals("/: is a folder"));
  CHECK_THROWS_WITH(ReadFile("/dev/zero"), Equals("/dev/zero: is not a regular file"));
  const TemporaryFolder folder;
  const std::string file = folder / "file";
  REQUIRE(mkfifo(file.c_str(), 0600) == 0);
  // nor does it wait for a writer
  CHECK_THROWS_WITH(ReadFile(file), Equals(file + ": is not a regular file"));
  fs::remove(file);
  CHECK_THROWS_WITH(ReadFile(file), Equals(file + ": cannot be opened"));
  std::ofstream(file).close();
  CHECK(ReadFile(file).empty());
  fs::resize_file(file, (size_t{16} << 20) + 1);
  CHECK_THROWS_WITH(ReadFile(file), Equals(file + ": is longer than 16 MB"));
}

struct ConfigFolder : TemporaryFolder {
  void Write(const std::string& name, const std::string& text) const {
    std::ofstream(*this / name) << text;
  }
};

TEST_CASE(
    "a file that extends another stands in its place, key by key, table by table, name by name") {
  const ConfigFolder folder;
  folder.Write("base.toml",
               "a = 1\nb = 2\nlist = [1, 2]\n[t]\nx = 1\ny = 2\n[t.deep]\nz = 3\n"
               "[[j]]\nname = \"hip\"\nm = 1\nn = 2\n[[j]]\nname = \"knee\"\nm = 3\n");
  folder.Write("own.toml",
               "extends = \"base.toml\"\nb = 20\nc = 30\nlist = [3]\n[t]\ny = 20\n[t.deep]\nw = 4\n"
               "[[j]]\nname = \"hip\"\nm = 10\n[[j]]\nname = \"toe\"\nm = 50\n[u]\nv = 1\n");
  folder.Write("last.toml", "extends = \"own.toml\"\nc = 300\n");
  std::vector<std::string> files;
  Config config = Config::Load(folder / "last.toml", &files);
  CHECK(files ==
        std::vector<std::string>{folder / "last.toml", folder / "own.toml", folder / "base.toml"});
  CHECK(config.Number("a") == 1);
  CHECK(config.Number("b") == 20);
  CHECK(config.Number("c") == 300);
  CHECK(config.Numbers("list", 1) == std::vector<double>{3});
  Config t = config.Table("t");
  CHECK(t.Number("x") == 1);
  CHECK(t.Number("y") == 20);
  CHECK(t.Table("deep").Number("z") == 3);
  CHECK(t.Table("deep").Number("w") == 4);
  CHECK(config.Table("u").Number("v") == 1);
  std::vector<Config> joints = config.Tables("j");
  REQUIRE(joints.size() == 3);
  CHECK(joints[0].Number("m") == 10);
  CHECK(joints[0].Number("n") == 2);
  CHECK(joints[1].Number("m") == 3);
  CHECK(joints[2].String("name") == "toe");
  config.Finish();
}

TEST_CASE("a file is without what it says of the file that it extends") {
  const ConfigFolder folder;
  folder.Write("base.toml",
               "a = 1\n[t]\nx = 1\ny = 2\n[t.deep]\n\"mass/leg\" = 3\nw = 4\n"
               "[[j]]\nname = \"hip\"\n[[j]]\nname = \"mass/knee\"\n[[k]]\nname = \"one\"\n");
  folder.Write("own.toml",
               "extends = \"base.toml\"\nwithout = [\"a\", \"t/x\", \"t/deep/mass/leg\", "
               "\"j/mass/knee\", \"k/one\"]\n[[j]]\nname = \"mass/knee\"\nm = 7\n");
  Config config = Config::Load(folder / "own.toml");
  CHECK_FALSE(config.Has("a"));
  CHECK_FALSE(config.Has("k"));
  CHECK_FALSE(config.Has("without"));
  Config t = config.Table("t");
  CHECK(t.Keys() == std::vector<std::string>{"y", "deep"});
  CHECK(t.Table("deep").Keys() == std::vector<std::string>{"w"});
  std::vector<Config> joints = config.Tables("j");
  REQUIRE(joints.size() == 2);
  CHECK(joints[0].String("name") == "hip");
  CHECK(joints[1].Number("m") == 7);  // what it says itself it has

  const auto refused = [&](const std::string& without, const std::string& why) {
    folder.Write("bad.toml", "extends = \"base.toml\"\nwithout = " + without + "\n");
    CHECK_THROWS_WITH(Config::Load(folder / "bad.toml"),
                      Catch::Contains((folder / "bad.toml") + why));
  };
  refused("3", ":2:11: without is not an array of texts");
  refused("[\"a\", 3]", ":2:17: without is not an array of texts");
  for (const char* none : {"b", "t/z", "t/deep/v", "j/toe", "a/b", ""}) {
    refused("[\"" + std::string(none) + "\"]",
            ":2:12: without \"" + std::string(none) + "\": the file that is extended has none");
  }
  CHECK_THROWS_WITH(Read("without = []\n").Finish(), Catch::Contains("without is not a known key"));
}

TEST_CASE("mistakes in files that extend each other are named in the file where they are") {
  const ConfigFolder folder;
  folder.Write("base.toml", "a = \"x\"\n[t]\nb = 1\n[[j]]\nname = \"hip\"\n");
  folder.Write("own.toml",
               "extends = \"base.toml\"\n[t]\nc = -1\nd = 1\n[[j]]\nname = \"hip\"\nm = "
               "-1\n[[j]]\nname = \"hip\"\n");
  Config config = Config::Load(folder / "own.toml");
  CHECK_THROWS_WITH(config.Number("a"), Equals((folder / "base.toml") + ":1:5: a is not a number"));
  Config t = config.Table("t");
  CHECK_THROWS_WITH(t.Number("e"), Equals((folder / "base.toml") + ":2:1: t.e is missing"));
  CHECK_THROWS_WITH(
      t.Number("c", kPositive),
      Equals((folder / "own.toml") + ":3:5: t.c = -1 is not a positive finite number"));
  CHECK(t.Number("b") == 1);
  CHECK_THROWS_WITH(t.Finish(),
                    Catch::Contains((folder / "own.toml") + ":4:5: t.d is not a known key"));
  CHECK(t.Position("d") == (folder / "own.toml") + ":4:5: ");
  std::vector<Config> joints = config.Tables("j");
  REQUIRE(joints.size() == 2);  // of the same name: for the reader to refuse
  CHECK_THROWS_WITH(
      joints[0].Number("m", kPositive),
      Equals((folder / "own.toml") + ":7:5: j[0].m = -1 is not a positive finite number"));

  const auto refused = [&](const std::string& text, const std::string& why) {
    folder.Write("bad.toml", text);
    CHECK_THROWS_WITH(Config::Load(folder / "bad.toml"),
                      Catch::Contains((folder / "bad.toml") + why));
  };
  refused("extends = 3\n", ":1:11: extends is not a string");
  refused("a = 1\nextends = \"none.toml\"\n",
          ":2:11: extends = \"none.toml\": there is no such file");
  refused("extends = \"bad.toml\"\n", ":1:11: extends a file that extends a file");
  folder.Write("folder.toml", "extends = \".\"\n");
  CHECK_THROWS_WITH(Config::Load(folder / "folder.toml"), Catch::Contains("is a folder"));
  CHECK_THROWS_WITH(Read("extends = \"base.toml\"\n").Finish(),
                    Catch::Contains("extends is not a known key"));
}

TEST_CASE("a key may hold a table or something else") {
  const Config config = Read("a = 1\nb = {c = 1}\n");
  CHECK_FALSE(config.IsTable("a"));
  CHECK(config.IsTable("b"));
  CHECK_FALSE(config.IsTable("c"));
  config.Finish();
}

TEST_CASE("what would keep the reader busy for minutes, or end it, is one line") {
  std::string deep = "[driver]\nx = 1\n", entries = "extends = [", names, tables;
  for (int i = 0; i < 200'000; ++i) deep += "a.";
  CHECK_THROWS_WITH(Read(deep + "a = 1\n"), Equals("robot.toml:3: a key of more than 16 parts"));
  for (const char* quoted : {"\"=\"", "'#'", "\"\\\"\"", "\"\""}) {
    std::string key = quoted;
    for (int i = 0; i < 20; ++i) key += std::string(" . ") + quoted;
    CHECK_THROWS_WITH(Read("[" + key + "]\n"), Equals("robot.toml:1: a key of more than 16 parts"));
  }
  // Of four or five quotes three end the text: what comes after them is read, too.
  for (const char* text : {"\"\"\"y\"\"\"\"", "\"\"\"y\"\"\"\"\"", "'''y''''", "'''''''"}) {
    CHECK_THROWS_WITH(Read(std::string("x = { b = ") + text + ", " + deep.substr(15) + "a = 1 }\n"),
                      Equals("robot.toml:1: a key of more than 16 parts"));
  }
  for (const char* endless :
       {"x = \"\"\"y", "x = \"\"\"", "x = '''y''", "x = \"y", "x = \"\"\"y\\"})
    CHECK_THROWS_AS(Read(endless), ConfigError);
  CHECK_NOTHROW(Read("x = \"\"\"y\"\"\"\""));
  for (int i = 0; i < 60'000; ++i) names += "name" + std::to_string(i) + " = 1\n";
  for (int i = 0; i < 20'000; ++i) {
    entries += "\"base.toml\",";
    tables += "[[joint]]\nname = \"a" + std::to_string(i) + "\"\n";
  }
  CHECK_THROWS_WITH(Read(entries + "]\n"),
                    Equals("robot.toml:1:11: 20000 entries, more than 10000"));
  CHECK_THROWS_WITH(Read(names), Catch::Contains("60000 entries, more than 10000"));
  CHECK_THROWS_WITH(Read(tables), Catch::Contains("20000 entries, more than 10000"));
}

TEST_CASE("what is taken away from a file that is extended is little") {
  const ConfigFolder folder;
  folder.Write("base.toml", "a = 1\n");
  std::string without;
  for (int i = 0; i <= 200; ++i) without += "\"a\",";
  folder.Write("own.toml", "extends = \"base.toml\"\nwithout = [" + without + "]\n");
  CHECK_THROWS_WITH(Config::Load(folder / "own.toml"),
                    Equals(folder / "own.toml:2:11: without more than 200 entries of a file"));
}

TEST_CASE("a file that is extended is as modest as one that is read, and names its own line") {
  const ConfigFolder folder;
  folder.Write("own.toml", "extends = \"base.toml\"\na = 1\n");
  const auto refused = [&](const std::string& base, const std::string& why) {
    folder.Write("base.toml", base);
    CHECK_THROWS_WITH(Config::Load(folder / "own.toml"), Equals((folder / "base.toml") + why));
  };
  std::string names = "[t]\n", list = "list = [", tables;
  for (int i = 0; i < 60'000; ++i) {
    names += "name" + std::to_string(i) + " = 1\n";
    tables += "[[joint]]\nname = \"a" + std::to_string(i) + "\"\n";
  }
  for (int i = 0; i < 20'000; ++i) list += "1,";
  refused(names, ":1:1: 60000 entries, more than 10000");
  refused(list + "]\n", ":1:8: 20000 entries, more than 10000");
  refused(tables, ":1:1: 60000 entries, more than 10000");
}

TEST_CASE("two files of as many names as may be are merged") {
  const ConfigFolder folder;
  std::string tables;
  for (int i = 0; i < 10'000; ++i)
    tables += "[[joint]]\nname = \"a" + std::to_string(i) + "\"\nm = 1\n";
  folder.Write("base.toml", tables);
  folder.Write("own.toml", "extends = \"base.toml\"\n" + tables);
  CHECK(Config::Load(folder / "own.toml").Tables("joint").size() == 10'000);
}

TEST_CASE("dots in strings, comments and numbers are no parts of keys") {
  const std::string dots(100, '.');
  Config config =
      Read("a = \"" + dots + "\" # " + dots + "\nb = '" + dots + "'\nc = \"\"\"\n" + dots +
           "\n\\\"\"\" " + dots + "\"\"\"\nd = [1.5, 1.5, 1.5, 1.5, 1.5, 1.5, 1.5, 1.5, 1.5, " +
           "1.5, 1.5, 1.5, 1.5, 1.5, 1.5, 1.5, 1.5, 1.5]\n" + "e.f.g.h.i.j = 1\n");
  CHECK(config.String("a") == dots);
  CHECK(config.String("b") == dots);
  CHECK(config.Numbers("d", 18)[17] == 1.5);
}

TEST_CASE("an error is one line, whatever it quotes") {
  CHECK_THROWS_WITH(Read("\"a\\nb\" = 1\n").Finish(),
                    Catch::Contains("a b is not a known key") && !Catch::Contains("\n"));
}

TEST_CASE("letters outside ASCII stand within quotes and comments only") {
  Config config = Read("\xEF\xBB\xBF# gr\u00fc\u00dfe\n\"m\u00fc\" = '\u00df'\n");
  CHECK(config.String("m\u00fc") == "\u00df");
  for (const char* text : {"a = 1\nm\u00fc = 1\n", "a = 1\n[\u00fc]\n", "a = 1\nb =\u00a01\n"}) {
    CHECK_THROWS_WITH(Read(text),
                      Equals("robot.toml:2: a character outside ASCII, and not within quotes"));
  }
  // A quote that opens no string.
  CHECK_THROWS_WITH(Read("a = -m\"\ufe3f"), Catch::StartsWith("robot.toml:1:"));
}

TEST_CASE("a text that controls a terminal is refused where it stands") {
  Config config = Read("name = \"\\u001b]0;title\\u0007\"\nother = \"m\\u00fc\"\n");
  CHECK_THROWS_WITH(config.String("name"),
                    Equals("robot.toml:1:8: name contains what cannot be printed"));
  CHECK(config.String("other") == "m\xc3\xbc");
}

}  // namespace
}  // namespace plumb
