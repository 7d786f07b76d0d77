// plumb-estimator: JOINT_STATE -> ROBOT_STATE, ROBOT_STATE_SMOOTHED.

#include <spdlog/spdlog.h>

#include "common/process.h"
#include "common/realtime.h"
#include "estimator/state_observer.h"

int main(int argc, char** argv) {
  std::string robot_path;
  int priority = 0;
  return plumb::Run(
      "plumb-estimator", "Estimates the robot's state from what its drives measure.", argc, argv,
      [&](CLI::App& app) {
        app.add_option("robot", robot_path, "robot folder or TOML file")->required();
        plumb::AddRealtimeFlag(app, priority);
      },
      [&](plumb::Process& process) {
        plumb::BecomeRealtime(priority);
        const plumb::RobotDescription robot = plumb::LoadRobot(robot_path);
        plumb::StateObserver observer(robot);
        plumb::Publisher<plumb::robot_state_t> causal(process.messenger(), "ROBOT_STATE");
        plumb::Publisher<plumb::robot_state_t> smoothed(process.messenger(), "ROBOT_STATE_SMOOTHED");
        plumb::Subscriber<plumb::joint_state_t> subscriber(
            process.messenger(), "JOINT_STATE", [&](const plumb::joint_state_t& measured) {
              if (!observer.OnJointState(measured)) return;
              causal.Publish(observer.state());
              for (const plumb::robot_state_t& state : observer.TakeSmoothed()) smoothed.Publish(state);
              if (observer.state().restarted) {
                spdlog::debug("filter restarted at sequence {}", observer.state().sequence);
              }
            });
        while (process.Wait(1'000'000)) subscriber.Rethrow();
        spdlog::info("{} measurements, {} refused, {} undecodable, {} restarts", subscriber.received(),
                     observer.refused(), subscriber.rejected(), observer.restarts());
        return 0;
      });
}
