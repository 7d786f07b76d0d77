// plumb-estimator: JOINT_STATE, IMU -> ROBOT_STATE, ROBOT_STATE_SMOOTHED, ESTIMATOR_STATUS.

#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>

#include <optional>

#include "common/examples.h"
#include "common/process.h"
#include "common/realtime.h"
#include "estimator/model/unscented_observer.h"
#include "estimator/state_observer.h"
#include "sim/model.h"
#include "sim/simulators.h"

namespace {

constexpr int64_t kStatusPeriod = 100'000;  // [us]

/// The robot that the filter on the simulator's dynamics takes for granted. @param model "nominal"
/// or a posterior.json.
plumb::RobotDescription AssumedRobot(const plumb::RobotDescription& robot,
                                     const std::string& model) {
  const plumb::Model simulated(robot);
  const bool nominal = model == "nominal";
  return simulated.Describe(nominal ? simulated.parameters().means()
                                    : plumb::ReadSimulators(model, robot).Mean());
}

}  // namespace

int main(int argc, char** argv) {
  std::string robot_path, model;
  int priority = 0;
  return plumb::Run(
      "plumb-estimator", "Estimates the robot's state from what its drives and sensors measure.",
      argc, argv,
      [&](CLI::App& app) {
        app.add_option("robot", robot_path, "robot folder or TOML file")->required();
        app.add_option("--model", model,
                       "ROBOT_STATE, for control, from a filter on the simulator's dynamics with "
                       "these parameters: a "
                       "posterior.json, or 'nominal', the prior's means; default: without");
        plumb::AddRealtimeFlag(app, priority);
        plumb::AddExamples(app, {"plumb-estimator robots/hopper --realtime-priority 75"});
      },
      [&](plumb::Process& process) {
        process.BecomeFast(priority);
        const plumb::RobotDescription robot = plumb::LoadRobot(robot_path);
        process.BeAlone(robot.name);
        plumb::StateObserver observer(robot);
        std::optional<plumb::UnscentedObserver> model_observer;
        if (!model.empty()) model_observer.emplace(AssumedRobot(robot, model));
        process.messenger().Follow(robot.name);
        plumb::Publisher<plumb::robot_state_t> causal(process.messenger(), "ROBOT_STATE");
        plumb::Publisher<plumb::robot_state_t> smoothed(process.messenger(),
                                                        "ROBOT_STATE_SMOOTHED");
        plumb::Publisher<plumb::estimator_status_t> statuses(process.messenger(),
                                                             "ESTIMATOR_STATUS");
        int64_t told = 0, told_at = 0;  // reasons_changed() and utime of the last status
        const auto publish_status = [&] {
          const int64_t now = observer.state().utime;
          if (told == observer.reasons_changed() && now >= told_at && now - told_at < kStatusPeriod)
            return;
          told = observer.reasons_changed();
          told_at = now;
          plumb::estimator_status_t status = observer.Status();
          if (model_observer) status.model_restarts = model_observer->restarts();
          statuses.Publish(status);
        };
        plumb::Subscriber<plumb::imu_t> imus(process.messenger(), "IMU",
                                             [&](const plumb::imu_t& imu) { observer.OnImu(imu); });
        plumb::Subscriber<plumb::joint_state_t> subscriber(
            process.messenger(), "JOINT_STATE", [&](const plumb::joint_state_t& measured) {
              if (!observer.OnJointState(measured)) return;
              if (model_observer) model_observer->OnJointState(measured, observer.state());
              causal.Publish(model_observer ? model_observer->state() : observer.state());
              for (const plumb::robot_state_t& state : observer.smoothed()) smoothed.Publish(state);
              publish_status();
              if (observer.state().restarted) {
                spdlog::debug("filter restarted at sequence {}", observer.state().sequence);
              }
            });
        while (process.Wait(1'000'000)) {
          subscriber.Rethrow();
          imus.Rethrow();
        }
        spdlog::info("{} measurements, {} unused, {} undecodable, {} restarts",
                     subscriber.received(), observer.unused(), subscriber.rejected(),
                     observer.restarts());
        if (model_observer)
          spdlog::info("filter on the simulator's dynamics: {} restarts",
                       model_observer->restarts());
        return 0;
      });
}
