#include "tests/process/stage.h"

#include <algorithm>
#include <cstring>
#include <fstream>
#include <iterator>

namespace plumb {

std::string Read(const std::filesystem::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

void Stage::Witness() {
  // Independent of the driver's own tables: node 1's Set_Input_Torque is 0x02E, its Heartbeat 0x021.
  std::array<Frame, 64> frames_now;
  for (int n; (n = bus->Receive(frames_now)) > 0;) {
    for (const Frame& frame : std::span(frames_now).first(static_cast<size_t>(n))) {
      ++frames;
      if (frame.remote || frame.error || frame.extended) continue;
      ++frames_by_id[frame.id];
      if (frame.id == 0x02E && frame.length >= 4) {
        std::memcpy(&torque, frame.data.data(), 4);
        if (torque == 0) continue;
        last_torque_time = frame.receive_ns / 1000;
        longest_alone = std::max(longest_alone, last_torque_time - last_command_made);
      } else if (frame.id == 0x021 && frame.length == 8) {
        axis_state = frame.data[4];
      }
    }
  }
}

}  // namespace plumb
