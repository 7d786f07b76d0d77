#include "drivers/driver/flight_recorder.h"

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/temporary_folder.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

Frame Text(const char* text) { return FrameFromText(text).value(); }

std::string Read(const fs::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

TEST_CASE("what was on the bus before a fault is written as candump writes, oldest first") {
  const TemporaryFolder folder;
  std::string written, error;
  {
    FlightRecorder recorder(
        folder.path() / "new", {.url = "udp:239.74.163.2:43113"}, 4,
        [&](const std::string& file, const std::string& what) { written = file, error = what; });
    for (int i = 0; i < 6; ++i) recorder.Record(Text("02E#0000C03F00000000"), true, 1'000'000 + i);
    recorder.Record(Text("029#R8"), false, 1'500'000);
    REQUIRE(recorder.Dump(1'000'004, 2'000'000, "pivot: no encoder estimate for 50 ms"));
  }
  CHECK(error.empty());
  CHECK(written == folder.path() / "new" / "fault_2000000.log");
  CHECK(Read(written) ==
        "# pivot: no encoder estimate for 50 ms\n"
        "(1.000004) udp:239.74.163.2:43113 02E#0000C03F00000000 T\n"
        "(1.000005) udp:239.74.163.2:43113 02E#0000C03F00000000 T\n"
        "(1.500000) udp:239.74.163.2:43113 029#R8 R\n");
}

TEST_CASE("each dump begins anew, and one at a time") {
  const TemporaryFolder folder;
  int reports = 0, dumps = 0;
  {
    FlightRecorder recorder(folder.path(), {.url = "can0"}, 20000,
                            [&](const std::string&, const std::string&) { ++reports; });
    for (int round = 0; round < 20; ++round) {
      for (int i = 0; i < 5000; ++i)
        recorder.Record(Text("181#40E20100"), false, round * 10'000 + i);
      dumps += recorder.Dump(0, round, "again");
    }
  }
  CHECK(dumps >= 1);
  CHECK(reports == dumps);
  int files = 0;
  for (const auto& entry : fs::directory_iterator(folder.path())) {
    ++files;
    const std::string text = Read(entry.path());
    CHECK(std::count(text.begin(), text.end(), '\n') % 5000 == 1);
  }
  CHECK(files == dumps);
}

TEST_CASE("without a folder nothing is recorded, and one that cannot be is an error") {
  FlightRecorder recorder({}, {.url = "can0"}, 100, {});
  recorder.Record(Text("181#40E20100"), false, 1);
  CHECK_FALSE(recorder.Dump(0, 2, "reason"));
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "file") << "x";
  CHECK_THROWS_WITH(FlightRecorder(folder.path() / "file" / "below", {.url = "can0"}, 100, {}),
                    Catch::EndsWith("/file/below: cannot be made: Not a directory"));
  std::string error;
  {
    FlightRecorder gone(folder.path() / "gone", {.url = "can0"}, 100,
                        [&](const std::string&, const std::string& what) { error = what; });
    gone.Record(Text("181#40E20100"), false, 1);
    fs::remove_all(folder.path() / "gone");
    CHECK(gone.Dump(0, 2, "reason"));
  }
  CHECK(error.find("fault_2.log") != std::string::npos);
}

}  // namespace
}  // namespace plumb
