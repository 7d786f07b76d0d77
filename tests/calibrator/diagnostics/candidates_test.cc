#include "calibrator/diagnostics/candidates.h"

#include <Eigen/Core>
#include <catch2/catch.hpp>
#include <vector>

#include "sim/model.h"
#include "sim/simulator.h"
#include "tests/calibrator/fitted_log.h"

namespace plumb {
namespace {

TEST_CASE("candidates are parameters of every robot's simulator, at the values that it has") {
  for (const char* name : {"pendulum", "hopper", "cartpole", "double_pendulum"}) {
    const RobotDescription robot = Robot(name);
    const std::vector<Candidate> candidates = FindCandidates(robot);
    REQUIRE(candidates.size() > 3);
    const Model model(WithCandidates(robot, candidates));
    Eigen::VectorXd own(robot.parameters.size());
    for (size_t i = 0; i < robot.parameters.size(); ++i)
      own(static_cast<Eigen::Index>(i)) = robot.parameters[i].mean;
    Eigen::VectorXd all(own.size() + static_cast<Eigen::Index>(candidates.size()));
    all << own, Eigen::VectorXd::NullaryExpr(
                    static_cast<Eigen::Index>(candidates.size()),
                    [&](Eigen::Index i) { return candidates[static_cast<size_t>(i)].value; });
    Simulator with(WithCandidates(robot, candidates)), without(robot);
    with.SetParameters(all);
    without.SetParameters(own);
    const Eigen::VectorXd q = Eigen::VectorXd::Constant(robot.num_positions(), 0.1);
    const Eigen::VectorXd v = Eigen::VectorXd::Constant(robot.num_velocities(), -0.2);
    for (Simulator* simulator : {&with, &without}) {
      simulator->SetState(q, v);
      simulator->Step(Eigen::VectorXd::Constant(v.size(), 0.3), 0.01);
    }
    INFO(name);
    CHECK((with.v() - without.v()).norm() < 1e-6);
  }
}

}  // namespace
}  // namespace plumb
