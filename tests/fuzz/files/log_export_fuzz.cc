// libFuzzer: any LCM log is played and written as MCAP and as tables, or refused.

#include "records/log_export.h"
#include "records/log_player.h"
#include "tests/fuzz/files/input_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  static const InputFile file("run.lcmlog");
  file.Write(Text(data, size));
  ReadOrRefuse<std::runtime_error>([&] {
    LogPlayer player(file.path().string(), {0, 1e6, false}, 1, 0);
    const int64_t messages = player.index().messages();
    int64_t played = 0;
    for (; !player.over(); player.Advance(0), ++played) {
      player.Remaining(played);
      player.Position(played);
    }
    Require(played <= messages);
    player.Seek(player.duration() / 2, 0);
  });
  const std::filesystem::path mcap = file.folder() / "run.mcap", tables = file.folder() / "tables";
  ReadOrRefuse<std::runtime_error>(
      [&] { ExportMcap(file.path().string(), mcap, &FuzzRobot(), {}); });
  ReadOrRefuse<std::runtime_error>([&] { ExportCsv(file.path().string(), tables); });
  std::error_code ignored;
  std::filesystem::remove_all(tables, ignored);
  return 0;
}
