#include "cli/meldis.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <stdexcept>

#include "plumb/robot_state_t.hpp"
#include "records/drake_viewer.h"

namespace plumb {
namespace {

constexpr int64_t kPeriod = 25'000;         // [us]; meldis looks as often
constexpr int64_t kLoadPeriod = 1'000'000;  // [us]; it may be started later

}  // namespace

int ShowInMeldis(Process& process, const std::string& robot_path) {
  if (process.participant())
    throw std::invalid_argument("meldis looks at a run in virtual time from outside: no --clock");
  const RobotDescription robot = LoadRobot(robot_path);
  DrakeViewer viewer(robot);
  Messenger& messenger = process.messenger();
  messenger.Become({});
  Publisher<drake::lcmt_viewer_load_robot> loads(messenger, "DRAKE_VIEWER_LOAD_ROBOT");
  Publisher<drake::lcmt_viewer_draw> draws(messenger, "DRAKE_VIEWER_DRAW");
  int64_t foreign = 0, drawn = 0, next_load = process.clock().Now(), utime = 0;
  Eigen::VectorXd q;  // empty: no new one
  Subscriber<robot_state_t> states(messenger, "ROBOT_STATE", [&](const robot_state_t& state) {
    const auto size = static_cast<Eigen::Index>(state.q.size());
    const Eigen::Map<const Eigen::VectorXd> heard(state.q.data(), size);
    if (size == robot.num_positions() && heard.allFinite()) {
      q = heard;
      utime = state.utime;
    } else if (foreign++ == 0) {
      spdlog::warn("a ROBOT_STATE of {} numbers is not one of {}", size, robot.name);
    }
  });
  do {
    if (process.clock().Now() >= next_load) {
      loads.Publish(viewer.load());
      next_load = process.clock().Now() + kLoadPeriod;
    }
    if (q.size() == 0) continue;
    draws.Publish(viewer.Draw(utime, q));
    q.resize(0);
    ++drawn;
  } while (process.Sleep(kPeriod));
  spdlog::info("{} states drawn, {} foreign", drawn, foreign);
  return 0;
}

}  // namespace plumb
