#include "records/mcap_writer.h"

#include <catch2/catch.hpp>
#include <filesystem>

#include "common/config.h"
#include "tests/records/mcap_file.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

TEST_CASE("what is written is read back, by the indexes, chunk by chunk") {
  const TemporaryFolder folder;
  const std::string file = folder / "a.mcap";
  McapWriter writer(file, "plumb test");
  writer.AddMetadata("record", {{"log", "a.lcmlog"}, {"note", ""}});
  const uint16_t schema = writer.AddSchema("plumb.a_t", "jsonschema", "{}");
  const uint16_t a = writer.AddChannel("A", schema, "json"),
                 b = writer.AddChannel("B", schema, "json"),
                 silent = writer.AddChannel("SILENT", schema, "json");
  std::vector<std::string> said;
  for (uint64_t i = 0; i < 30'000; ++i) {
    said.push_back("{\"i\":" + std::to_string(i) + std::string(i % 200, ' ') + "}");
    // Now and then one is late.
    const uint64_t logged = 1'000'000 * i - (i % 10 == 9 ? 1'500'000 : 0);
    writer.Write(i % 3 == 0 ? b : a, logged, logged / 2, said.back());
  }
  CHECK_FALSE(std::filesystem::exists(file));  // it is there when it is whole
  writer.Finish();
  CHECK(silent == 2);
  const McapFile read(ReadFile(file));
  CHECK(read.chunks > 2);
  CHECK(read.messages.size() == 30'000);
  CHECK(read.schemas.at(schema).name == "plumb.a_t");
  CHECK(read.schemas.at(schema).encoding == "jsonschema");
  CHECK(read.schemas.at(schema).data == "{}");
  CHECK(read.channels.at(b).encoding == "json");
  CHECK(read.metadata.at("record").at("log") == "a.lcmlog");
  CHECK(read.metadata.at("record").at("note").empty());
  CHECK(read.Of("SILENT").empty());
  auto in_b = read.Of("B");
  REQUIRE(in_b.size() == 10'000);
  std::ranges::sort(in_b, {}, &McapFile::Message::sequence);
  for (size_t i = 0; i < in_b.size(); ++i) {
    REQUIRE(in_b[i].sequence == i);
    REQUIRE(in_b[i].data == said[3 * i]);
    REQUIRE(in_b[i].published == in_b[i].logged / 2);
  }
}

TEST_CASE(
    "an empty file is one, too; what is not finished leaves nothing; a full disk has a name") {
  const TemporaryFolder folder;
  McapWriter(folder / "empty.mcap", "plumb test").Finish();
  CHECK(McapFile(ReadFile(folder / "empty.mcap")).messages.empty());
  { McapWriter unfinished(folder / "unfinished.mcap", "plumb test"); }
  CHECK(std::distance(std::filesystem::directory_iterator(folder.path()), {}) == 1);
  CHECK_THROWS_WITH(McapWriter(folder / "none/a.mcap", "plumb test"),
                    folder / "none/a.mcap" + ": cannot be written: No such file or directory");
}

}  // namespace
}  // namespace plumb
