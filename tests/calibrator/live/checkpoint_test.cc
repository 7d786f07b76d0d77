#include "calibrator/live/checkpoint.h"

#include <Eigen/Core>
#include <catch2/catch.hpp>
#include <fstream>
#include <string>

#include "calibrator/live/simopt.h"
#include "common/config.h"
#include "tests/calibrator/synthetic.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

TEST_CASE("no bit of a checkpoint can be changed unnoticed, nor a size be wrong") {
  const RobotDescription robot = Pendulum();
  SimOpt::State state = SimOpt(robot, 1, 1).state();
  Transition t{};
  for (auto* x : {&t.q, &t.v, &t.next_q, &t.next_v, &t.q_sd, &t.v_sd, &t.next_q_sd, &t.next_v_sd})
    x->setConstant(1, 0.25);
  t.efforts = {{0.05, Eigen::VectorXd::Ones(1)}};
  state.rollouts = {{1, 0, {t}}};
  state.rollouts_per_iteration = {1};
  const TemporaryFolder folder;
  const auto load = [&] { return CalibrationCheckpoint(folder.path(), robot, 1).Load(); };
  CalibrationCheckpoint(folder.path(), robot, 1).Save(state);
  REQUIRE(load()->rollouts.size() == 1);
  for (const char* name : {"calibration.checkpoint", "rollout_0.checkpoint"}) {
    const std::string good = ReadFile(folder / name);
    for (size_t bit = 0; bit < 8 * good.size(); ++bit) {
      std::string damaged = good;
      damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << bit % 8));
      std::ofstream(folder / name) << damaged;
      REQUIRE_THROWS_WITH(load(), Catch::Contains(name));
    }
    std::ofstream(folder / name) << good;
  }
  // Whole, but of no such robot, or of none at all.
  state.rollouts[0].transitions[0].v_sd.setConstant(2, 0.25);
  CalibrationCheckpoint(folder.path(), robot, 1).Save(state);
  CHECK_THROWS_WITH(load(), Catch::Contains("wrong size"));
  CHECK_THROWS_WITH(LoadRollouts(folder.path(), robot),
                    Catch::Contains("rollout_0.checkpoint: a transition has the wrong size"));
  state.rollouts[0].transitions[0].v_sd.setConstant(1, 1e-160);
  CalibrationCheckpoint(folder.path(), robot, 1).Save(state);
  CHECK_THROWS_WITH(load(), Catch::Contains("not physical"));
  state.rollouts[0].transitions[0].v_sd.setConstant(1, 0.25);
  state.rollouts[0].transitions[0].efforts.clear();
  CalibrationCheckpoint(folder.path(), robot, 1).Save(state);
  CHECK_THROWS_WITH(load(), Catch::Contains("no efforts"));
}

}  // namespace
}  // namespace plumb
