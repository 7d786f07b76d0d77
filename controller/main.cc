// plumb-controller: ROBOT_STATE, POLICY, DRIVER_STATUS -> JOINT_COMMAND, PLACE_ROBOT,
// CONTROLLER_STATUS.

#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>

#include <optional>

#include "common/examples.h"
#include "common/process.h"
#include "common/realtime.h"
#include "common/seed_range.h"
#include "controller/controller.h"
#include "sim/tasks/effort_table.h"

int main(int argc, char** argv) {
  std::string robot_path;
  uint64_t seed = 1;
  double rest = -1;
  std::string efforts;
  int priority = 0;
  return plumb::Run(
      "plumb-controller", "Runs a policy on the robot, episode by episode.", argc, argv,
      [&](CLI::App& app) {
        app.add_option("robot", robot_path, "robot folder or TOML file")->required();
        plumb::AddRealtimeFlag(app, priority);
        app.add_option("--seed", seed, "of initial states and exploration")
            ->check(plumb::SeedRange())
            ->capture_default_str();
        app.add_option(
               "--rest", rest,
               "[s] do not have the robot placed: let it rest that long, then begin where it is")
            ->check(CLI::Range(0.0, 1e6));
        app.add_option("--efforts", efforts,
                       "play this table of `plumb excite` in one episode, and no policy");
        plumb::AddExamples(app, {"plumb-controller robots/pendulum --rest 2"});
      },
      [&](plumb::Process& process) {
        process.BecomeFast(priority);
        const plumb::RobotDescription robot = plumb::LoadRobot(robot_path);
        process.BeAlone(robot.name);
        const plumb::Clock& clock = process.clock();
        plumb::Controller controller(robot, seed, rest);
        if (!efforts.empty())
          controller.Play(plumb::ReadEffortTable(efforts, robot, *plumb::MakeTask(robot)));
        plumb::Messenger& messenger = process.messenger();
        messenger.Follow(robot.name);
        plumb::Publisher<plumb::joint_command_t> commands(messenger, "JOINT_COMMAND");
        plumb::Publisher<plumb::place_robot_t> places(messenger, "PLACE_ROBOT");
        plumb::Publisher<plumb::controller_status_t> statuses(messenger, "CONTROLLER_STATUS");

        const auto send = [&](const std::optional<plumb::joint_command_t>& command) {
          if (command) commands.Publish(*command);
        };
        plumb::Subscriber<plumb::robot_state_t> states(
            messenger, "ROBOT_STATE", [&](const plumb::robot_state_t& state) {
              send(controller.OnState(state, clock.Now(), clock.Utime()));
            });
        plumb::Subscriber<plumb::driver_status_t> drivers(
            messenger, "DRIVER_STATUS", [&](const plumb::driver_status_t& status) {
              controller.OnDriverStatus(status, clock.Now());
            });
        plumb::Subscriber<plumb::policy_t> policies(
            messenger, "POLICY", [&](const plumb::policy_t& policy) {
              try {
                controller.OnPolicy(policy);
              } catch (const std::invalid_argument& error) {
                spdlog::warn("policy {} refused: {}", policy.iteration, error.what());
              }
            });

        constexpr int64_t kTick = 10'000, kStatusPeriod = 100'000;  // [us]
        int64_t published = clock.Now() - kStatusPeriod, seen = -1;
        while (process.Wait(kTick)) {
          states.Rethrow(), drivers.Rethrow(), policies.Rethrow();
          const int64_t now = clock.Now();
          send(controller.Tick(now, clock.Utime()));
          const bool changed = controller.changes() != seen;
          if (changed && controller.phase() == plumb::controller_status_t::HALTED) {
            spdlog::warn("halted: {}", controller.status().reason);
          }
          if (changed || now - published >= kStatusPeriod) {
            plumb::controller_status_t status = controller.status();
            status.utime = clock.Utime();
            statuses.Publish(status);
            if (controller.place()) places.Publish(*controller.place());
            published = now;
            seen = controller.changes();
          }
        }
        return 0;
      });
}
