#include "sim/simulator_lanes.h"

#include <catch2/catch.hpp>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "sim/environment.h"
#include "tests/sim/allocations.h"
#include "tests/sim/residuals.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

using Eigen::VectorXd;
using Eigen::VectorXf;

// Environments of one model, each with parameters, a state and actions of its own, some of which
// may have left.
struct Fleet {
  Fleet(const std::shared_ptr<const Model>& model, int count, bool driver)
      : nominal(model->parameters().size()) {
    for (Eigen::Index k = 0; k < nominal.size(); ++k)
      nominal[k] = model->description().parameters[static_cast<size_t>(k)].mean;
    for (int i = 0; i < count; ++i) {
      auto& environment = environments.emplace_back(model);
      if (driver) environment.SendThroughDriver();
      Random random(1, {static_cast<uint32_t>(i)});
      VectorXd physical = nominal;
      for (double& value : physical) value *= random.Uniform(0.8, 1.2);
      // Of the first one as it was made: its parameters are never set.
      if (i > 0) environment.SetParameters(physical);
      environment.Reset(random);
      randoms.push_back(random);
      there.push_back(true);
    }
    actions.resize(environments[0].action_size(), count);
  }

  // Every second one has a residual.
  void Lack(const std::shared_ptr<const Residual>& residual) {
    for (size_t i = 0; i < environments.size(); i += 2) {
      environments[i].SetResidual(residual);
      environments[i].Reset(randoms[i]);
    }
  }
  void Choose() {
    for (Eigen::Index i = 0; i < actions.cols(); ++i) {
      for (float& action : actions.col(i))
        action = static_cast<float>(randoms[static_cast<size_t>(i)].Uniform(-1.2, 1.2));
    }
  }
  std::vector<Environment::Move> Moves() {
    std::vector<Environment::Move> moves;
    for (size_t i = 0; i < environments.size(); ++i) {
      if (there[i])
        moves.push_back(
            {&environments[i], {actions.col(static_cast<Eigen::Index>(i)).data(), actions.rows()}});
    }
    return moves;
  }

  VectorXd nominal;
  std::vector<Environment> environments;
  std::vector<Random> randoms;
  std::vector<bool> there;
  Eigen::MatrixXf actions;
};

}  // namespace

TEST_CASE("environments side by side have the bits of each alone") {
  struct Case {
    const char* file;
    bool driver, residual;
  };
  const auto [file, driver, residual] =
      GENERATE(values<Case>({{"hopper/gym.toml", false, false},
                             {"hopper/robot.toml", true, false},
                             {"hopper/robot.toml", true, true},
                             {"pendulum/gym.toml", false, false},
                             {"pendulum/worn_fitted.toml", true, true},  // with a delay
                             {"double_pendulum/robot.toml", false, true},
                             {"quadruped/robot.toml", true, false}}));
  CAPTURE(file);
  constexpr int kCount = 11;  // more than lanes, and not as many as make them full
  const auto model =
      std::make_shared<const Model>(LoadRobot(SourceFile(std::string("robots/") + file)));
  Fleet alone(model, kCount, driver), together(model, kCount, driver);
  if (residual) {
    const auto learnt = Of(model->description());
    learnt->free = learnt->touching =
        Constant(model->description(), VectorXd::Constant(model->num_velocities(), 0.125));
    learnt->free->noise.diagonal().setConstant(0.01);
    for (Fleet* fleet : {&alone, &together}) fleet->Lack(learnt);
  }
  SimulatorLanes lanes(model);
  for (int step = 0; step < 30; ++step) {
    // Some leave, so that others change lanes; one comes back as another robot.
    if (step == 10) alone.there[3] = alone.there[9] = together.there[3] = together.there[9] = false;
    if (step == 20) {
      for (Fleet* fleet : {&alone, &together}) {
        fleet->environments[3].SetParameters(fleet->nominal);
        fleet->there[3] = true;
      }
    }
    alone.Choose(), together.Choose();
    auto one = alone.Moves(), all = together.Moves();
    for (auto& move : one) move.result = move.environment->Step(move.action);
    Environment::Step(all, lanes);
    for (size_t i = 0; i < one.size(); ++i) {
      CAPTURE(step, i);
      REQUIRE(one[i].environment->q() == all[i].environment->q());
      REQUIRE(one[i].environment->v() == all[i].environment->v());
      REQUIRE(one[i].environment->reading_q() == all[i].environment->reading_q());
      REQUIRE(one[i].result.reward == all[i].result.reward);
      REQUIRE(one[i].result.terminated == all[i].result.terminated);
    }
  }
}

TEST_CASE("a simulation that has blown up leaves those beside it alone") {
  const auto model = std::make_shared<const Model>(LoadPendulum("robot.toml"));
  Fleet alone(model, 4, false), together(model, 4, false);
  SimulatorLanes lanes(model);
  for (Fleet* fleet : {&alone, &together})
    fleet->environments[1].SetState(VectorXd::Constant(1, 0), VectorXd::Constant(1, 1e308));
  for (int step = 0; step < 3; ++step) {
    alone.Choose(), together.Choose();
    auto one = alone.Moves(), all = together.Moves();
    for (auto& move : one) move.result = move.environment->Step(move.action);
    Environment::Step(all, lanes);
    CHECK(all[1].result.terminated);
    for (const size_t i : {0, 2, 3}) CHECK(one[i].environment->q() == all[i].environment->q());
  }
}

TEST_CASE("steps side by side do not allocate, and only of one model there are any") {
  const auto model = std::make_shared<const Model>(LoadPendulum("robot.toml"));
  Fleet fleet(model, 5, false);
  SimulatorLanes lanes(model);
  fleet.Choose();
  auto moves = fleet.Moves();
  Environment::Step(moves, lanes);
  const int64_t before = Allocations();
  Environment::Step(moves, lanes);
  CHECK(Allocations() == before);

  Simulator stranger(LoadPendulum("robot.toml"));
  stranger.Prepare(VectorXd::Zero(1), 0.01);
  CHECK_THROWS_AS(lanes.Add(stranger), std::invalid_argument);
}

}  // namespace plumb
