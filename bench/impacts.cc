// How honest the observer's standard deviations are at impacts and elsewhere, on hoppers on their
// bus in virtual time: tables for docs/measurements/estimator.md. build/bench/impacts [motions]

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include "sim/touch.h"
#include "tests/calibrator/hop_on_bus.h"
#include "tests/estimator/observer_errors.h"

namespace plumb {
namespace {

constexpr int kAround = 5;  // measurements
constexpr size_t kSettle = 50;
enum When { kFree, kStanding, kGround, kStop, kAlways, kWhens };
constexpr const char* kNames[] = {"in the air", "on the ground", "touchdown, lift-off", "at a stop",
                                  "always"};

/// Stops count for 10 ms around, then changes of contact.
std::vector<When> WhenOf(const RobotDescription& robot, const Samples& motion) {
  std::vector<Touch> touch;
  for (const SimulatedReadings::Sample& sample : motion)
    touch.push_back(TouchFinder(robot).Find(sample.q));
  std::vector<When> when;
  const int n = static_cast<int>(motion.size());
  for (int k = 0; k < n; ++k) {
    When now = touch[static_cast<size_t>(k)].ground ? kStanding : kFree;
    for (int i = std::max(1, k - kAround); i <= std::min(n - 1, k + kAround); ++i) {
      const Touch &at = touch[static_cast<size_t>(i)], &before = touch[static_cast<size_t>(i - 1)];
      if (at.stop) now = kStop;
      if (now != kStop && at.ground != before.ground) now = kGround;
    }
    when.push_back(now);
  }
  return when;
}

void Print(const std::string& name, const RobotDescription& robot,
           const std::vector<Samples>& motions) {
  const auto n = static_cast<size_t>(robot.num_joints());
  std::vector<std::vector<StateErrors>> errors(kWhens, std::vector<StateErrors>(n));
  std::vector<int> counts(kWhens, 0);
  for (const Samples& motion : motions) {
    const std::vector<When> when = WhenOf(robot, motion);
    StateObserver observer(robot);
    size_t next = 0;
    for (const SimulatedReadings::Sample& sample : motion) {
      for (const imu_t& imu : sample.imus) observer.OnImu(imu);
      observer.OnJointState(sample.joints);
      for (const robot_state_t& state : observer.smoothed()) {
        const size_t k = next++;
        if (k < kSettle) continue;
        for (const When w : {when[k], kAlways}) {
          ++counts[w];
          for (size_t i = 0; i < n; ++i) {
            const auto at = static_cast<Eigen::Index>(i);
            errors[w][i].Add(state.q[i] - motion[k].q[at], state.v[i] - motion[k].v[at],
                             state.q_sd[i], state.v_sd[i]);
          }
        }
      }
    }
  }
  for (const When w : {kFree, kStanding, kGround, kStop, kAlways}) {
    if (counts[w] == 0) continue;
    for (size_t i = 0; i < n; ++i) {
      const StateErrors& e = errors[w][i];
      fmt::print("| {} | {} ({}) | {} | {:.2f} | {:.2f} | {:.0f} % | {:.2g} |\n", name, kNames[w],
                 counts[w], robot.joints[i].name, e.nees_q(), e.nees_v(), 100 * e.covered_v(),
                 e.v());
    }
  }
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  using namespace plumb;
  const auto motions = static_cast<uint32_t>(argc > 1 ? std::atoi(argv[1]) : 6);
  RobotDescription robot = LoadRobot(std::string(PLUMBLINE_SOURCE) + "/robots/hopper");
  robot.estimator.delay = 0;  // in virtual time frames arrive at once
  std::vector<Samples> springs, bang_bang;
  for (uint32_t seed = 1; seed <= motions; ++seed) {
    springs.push_back(HopOnBus(robot, seed));
    for (Samples& episode : BangBangOnBus(robot, seed)) bang_bang.push_back(std::move(episode));
  }
  fmt::print(
      "| hopper | when (states) | joint | NEES q | NEES v | v within 95 % | rms v "
      "|\n|---|---|---|---|---|---|---|\n");
  Print("springs", robot, springs);
  Print("bang-bang", robot, bang_bang);
  for (JointDescription& joint : robot.joints)
    joint.noise.ground_impact = joint.noise.stop_impact = 0;
  Print("bang-bang, no impacts", robot, bang_bang);
}
