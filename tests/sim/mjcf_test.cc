// What Mjcf writes, as MuJoCo reads it: the same robot, under the same names.
#include "sim/mjcf.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <memory>

#include "examples/mujoco/parameters.h"
#include "robot/parameter_distribution.h"
#include "sim/simulator.h"
#include "tests/sim/robots.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

using Eigen::VectorXd;

struct Mujoco {
  explicit Mujoco(const RobotDescription& robot) {
    const TemporaryFolder folder;
    const std::string file = folder / "robot.xml";
    std::ofstream(file) << Mjcf(robot);
    char error[1000] = "";
    model.reset(mj_loadXML(file.c_str(), nullptr, error, sizeof error));
    INFO(error);
    REQUIRE(model);
    data.reset(mj_makeData(model.get()));
    for (const JointDescription& joint : robot.joints) {
      const int id = mj_name2id(model.get(), mjOBJ_JOINT, joint.name.c_str());
      REQUIRE(id >= 0);
      for (int k = 0; k < joint.num_positions(); ++k) q.push_back(model->jnt_qposadr[id] + k);
      for (int k = 0; k < joint.num_velocities(); ++k) v.push_back(model->jnt_dofadr[id] + k);
    }
  }

  struct Delete {
    void operator()(mjModel* m) const { mj_deleteModel(m); }
    void operator()(mjData* d) const { mj_deleteData(d); }
  };
  std::unique_ptr<mjModel, Delete> model;
  std::unique_ptr<mjData, Delete> data;
  std::vector<int> q, v;  // addresses of our coordinates
};

struct State {
  VectorXd q, v;
};

/// Within all limits, above the ground.
State DrawState(const RobotDescription& robot, Random& random) {
  State state{VectorXd(robot.num_positions()), VectorXd(robot.num_velocities())};
  Eigen::Index at = 0;
  for (const JointDescription& joint : robot.joints) {
    if (joint.num_positions() == 4) {
      Eigen::Vector4d turn;
      for (double& entry : turn) entry = random.Normal();
      state.q.segment<4>(at) = turn.normalized();
    } else {
      const double lower = std::max(joint.lower, -3.), upper = std::min(joint.upper, 3.);
      state.q(at) = lower + (upper - lower) * random.Uniform(0.05, 0.95);
    }
    if (joint.name == "rootz" || joint.name == "base/z") state.q(at) = 20;
    at += joint.num_positions();
  }
  for (double& entry : state.v) entry = random.Uniform(-5, 5);
  return state;
}

/// A robot of the prior, without Coulomb friction: whether that holds a joint is the solver's.
RobotDescription DrawRobot(const RobotDescription& robot, Random& random) {
  const ParameterDistribution prior = ParameterDistribution::Prior(robot);
  RobotDescription drawn = Model(robot).Describe(prior.Sample(random).cwiseAbs());
  for (JointDescription& joint : drawn.joints) joint.dynamics.friction = 0;
  return drawn;
}

}  // namespace

TEST_CASE("mjcf: mass matrix and accelerations are the simulator's") {
  const std::string name = GENERATE("pendulum", "pendulum/weak.toml", "double_pendulum", "cartpole",
                                    "hopper", "hopper/free.toml", "quadruped");
  INFO(name);
  Random random(1);
  const RobotDescription known = LoadRobot(SourceFile("robots/" + name));
  for (int i = 0; i < 20; ++i) {
    const RobotDescription robot = DrawRobot(known, random);
    Mujoco theirs(robot);
    Simulator ours(robot);
    const State state = DrawState(robot, random);
    ours.SetState(state.q, state.v);
    VectorXd effort = VectorXd::Zero(robot.num_velocities());
    Eigen::Index motor = 0, dof = 0;
    for (const JointDescription& joint : robot.joints) {
      if (!joint.passive) {
        effort(dof) = joint.effort_limit * random.Uniform(-1, 1);
        REQUIRE(mj_name2id(theirs.model.get(), mjOBJ_ACTUATOR, joint.name.c_str()) == motor);
        theirs.data->ctrl[motor++] = effort(dof);
      }
      dof += joint.num_velocities();
    }
    for (size_t k = 0; k < theirs.q.size(); ++k)
      theirs.data->qpos[theirs.q[k]] = state.q(static_cast<Eigen::Index>(k));
    for (size_t k = 0; k < theirs.v.size(); ++k)
      theirs.data->qvel[theirs.v[k]] = state.v(static_cast<Eigen::Index>(k));
    mj_forward(theirs.model.get(), theirs.data.get());
    REQUIRE(theirs.data->nefc == 0);

    const Eigen::Index n = robot.num_velocities();
    Eigen::MatrixXd full(n, n);
    mj_fullM(theirs.model.get(), full.data(), theirs.data->qM);
    const Eigen::MatrixXd mass = ours.MassMatrix();
    const VectorXd acceleration = ours.Acceleration(effort);
    VectorXd found(n);
    Eigen::MatrixXd found_mass(n, n);
    for (Eigen::Index k = 0; k < n; ++k) {
      found(k) = theirs.data->qacc[theirs.v[static_cast<size_t>(k)]];
      for (Eigen::Index l = 0; l < n; ++l)
        found_mass(k, l) = full(theirs.v[static_cast<size_t>(k)], theirs.v[static_cast<size_t>(l)]);
    }
    CHECK((found_mass - mass).norm() < 1e-9 * mass.norm());
    CHECK((found - acceleration).norm() < 1e-8 * acceleration.norm());
  }
}

TEST_CASE("mjcf: a model that is given other parameters is the model of these parameters") {
  RobotDescription known = LoadRobot(SourceFile("robots/cartpole"));
  for (const char* name :
       {"mass/pole", "mass/cart", "inertia/pole", "stiffness/cart", "rest/cart", "gain/cart",
        "gravity", "damping/cart", "friction/cart", "armature/cart"}) {
    if (known.FindParameter(name) < 0)
      known.parameters.push_back({name, "", ParameterDescription::Coordinate::kLog, 1.2, 0.3});
  }
  // The length is geometry.
  std::erase_if(known.parameters, [](const auto& p) { return p.name.starts_with("length/"); });
  const ParameterDistribution prior = ParameterDistribution::Prior(known);
  const Model model(known);
  Random random(2);
  for (int i = 0; i < 10; ++i) {
    const VectorXd sample = prior.Sample(random);
    const Mujoco wanted(model.Describe(sample));
    Mujoco changed(model.Describe(prior.Mean()));
    for (size_t k = 0; k < known.parameters.size(); ++k) {
      const auto at = static_cast<Eigen::Index>(k);
      SetParameter(changed.model.get(), known.parameters[k].name, sample(at), prior.Mean()(at));
    }
    mj_setConst(changed.model.get(), changed.data.get());
    for (const Mujoco* mujoco : {&wanted, &const_cast<const Mujoco&>(changed)}) {
      mjData* data = mujoco->data.get();
      mj_resetData(mujoco->model.get(), data);
      data->qpos[0] = 0.3, data->qpos[1] = 0.8, data->qvel[0] = -0.4, data->qvel[1] = 2;
      for (int step = 0; step < 100; ++step) {
        data->ctrl[0] = std::sin(0.1 * step);
        mj_step(mujoco->model.get(), data);
      }
    }
    for (int k = 0; k < 2; ++k) {
      CHECK(changed.data->qpos[k] == Approx(wanted.data->qpos[k]).epsilon(1e-9));
      CHECK(changed.model->dof_invweight0[k] ==
            Approx(wanted.model->dof_invweight0[k]).epsilon(1e-9));
    }
  }
  Mujoco any(known);
  CHECK_THROWS_WITH(SetParameter(any.model.get(), "length/pole", 1, 1),
                    Catch::Contains("length/pole"));
  CHECK_THROWS_WITH(SetParameter(any.model.get(), "mass/leg", 1, 1), Catch::Contains("mass/leg"));
}

TEST_CASE("mjcf: no contact is lost: what touches has to be a body") {
  RobotDescription robot = LoadRobot(SourceFile("robots/hopper/gym.toml"));
  const auto slide = std::find_if(robot.links.begin() + 1, robot.links.end(),
                                  [](const LinkDescription& link) { return link.mass == 0; });
  REQUIRE(slide != robot.links.end());
  CHECK_NOTHROW(Mjcf(robot));
  slide->collisions.push_back({});
  CHECK_THROWS_WITH(Mjcf(robot), Catch::Contains(slide->name));
}

TEST_CASE("mjcf: names are the robot's, whatever characters they have") {
  RobotDescription robot = MakeTree();
  robot.links[1].name = "a <\"big\"> & 'odd' link";
  robot.joints[0].name = "rail <&>\"'";
  const Mujoco theirs(robot);
  CHECK(mj_name2id(theirs.model.get(), mjOBJ_BODY, robot.links[1].name.c_str()) == 1);
  CHECK(mj_name2id(theirs.model.get(), mjOBJ_JOINT, robot.joints[0].name.c_str()) == 0);
}

}  // namespace plumb
