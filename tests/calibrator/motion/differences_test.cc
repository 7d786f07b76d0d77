#include "calibrator/motion/differences.h"

#include <catch2/catch.hpp>
#include <functional>

#include "tests/calibrator/fitted_log.h"

namespace plumb {
namespace {

using Names = std::vector<std::string>;

/// The log with velocities that `velocity` makes of its positions: before, at, and after a state.
std::vector<Rollout> With(std::vector<Rollout> log,
                          const std::function<Eigen::VectorXd(const Transition* before,
                                                              const Transition& at)>& velocity) {
  std::vector<Rollout> changed = log;
  for (size_t r = 0; r < log.size(); ++r) {
    const auto& t = log[r].transitions;
    auto& to = changed[r].transitions;
    for (size_t k = 0; k < t.size(); ++k) {
      to[k].v = velocity(k > 0 ? &t[k - 1] : nullptr, t[k]);
      if (k > 0) to[k - 1].next_v = to[k].v;
    }
  }
  return changed;
}

}  // namespace

TEST_CASE("velocities that are differences of positions are recognised, whatever the noise") {
  const RobotDescription robot = Robot("double_pendulum");
  const double h = robot.task.period;
  for (const double noise : {0.0, 1e-3}) {
    const std::vector<Rollout> log = RandomLog(robot, {{}, noise, noise}, 200, 2);
    CHECK(DifferencedJoints(robot, log).empty());
    const Names both{"shoulder", "elbow"};
    CHECK(DifferencedJoints(robot, With(log, [&](const Transition* before, const Transition& at) {
                              return before ? ((at.q - before->q) / h).eval() : at.v;
                            })) == both);
    CHECK(DifferencedJoints(robot, With(log, [&](const Transition*, const Transition& at) {
                              return ((at.next_q - at.q) / h).eval();
                            })) == both);
    CHECK(DifferencedJoints(robot, With(log, [&](const Transition* before, const Transition& at) {
                              return before ? ((at.next_q - before->q) / (2 * h)).eval() : at.v;
                            })) == both);
    // rounded to 1e-4, of one joint only
    CHECK(DifferencedJoints(robot, With(log, [&](const Transition* before, const Transition& at) {
                              Eigen::VectorXd v = at.v;
                              if (before)
                                v(1) = std::round((at.q(1) - before->q(1)) / h * 1e4) / 1e4;
                              return v;
                            })) == Names{"elbow"});
  }
  // Too few to tell.
  CHECK(DifferencedJoints(robot, RandomLog(robot, {}, 10, 2)).empty());
}

TEST_CASE("gym's pendulum moves by differences: these are its velocities") {
  const RobotDescription robot = Robot("pendulum/gym.toml");
  CHECK(DifferencedJoints(robot, RandomLog(robot, {}, 200, 2)).empty());
}

TEST_CASE("what velocities of differences mean is said") {
  const Names joints{"hip", "knee"};
  CHECK_THAT(DifferencesWarning(joints),
             Catch::StartsWith("v/hip, v/knee are made of differences of the positions, and "));
}

}  // namespace plumb
