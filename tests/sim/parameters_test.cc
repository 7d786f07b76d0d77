#include "sim/parameters.h"

#include <catch2/catch.hpp>
#include <limits>

#include "common/decompositions.h"
#include "sim/model.h"
#include "sim/simulator.h"
#include "tests/replaced.h"
#include "tests/robot/zoo.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

using Coordinate = ParameterDescription::Coordinate;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

RobotDescription WithParameters(RobotDescription robot, const std::vector<std::string>& paths) {
  robot.parameters.clear();
  for (const std::string& path : paths)
    robot.parameters.push_back({path, "", Coordinate::kLinear, 0.5, 0.1});
  return robot;
}

RobotDescription Describe(const RobotDescription& robot, const std::vector<std::string>& paths,
                          const VectorXd& physical) {
  return Model(WithParameters(robot, paths)).Describe(physical);
}

}  // namespace

TEST_CASE("parameters become the inertias of a uniform rod") {
  const Model model(LoadPendulum("robot.toml"));
  const double m = 2.5, l = 0.7;
  const RobotDescription robot = model.Describe(Vector3d(9, m, l));
  CHECK(robot.simulation.gravity == 9);
  CHECK(robot.links[1].mass == Approx(m).epsilon(1e-15));
  CHECK(robot.links[1].center_of_mass.isApprox(Vector3d(0, 0, l / 2), 1e-15));
  const Vector3d moments(m * l * l / 12, m * l * l / 12, 0);
  CHECK((robot.links[1].inertia - Matrix3d(moments.asDiagonal())).norm() < 1e-15);
}

TEST_CASE("parameters that are not physical are refused and change nothing") {
  const Model model(LoadPendulum("robot.toml"));
  Physics<double> physics = model.parameters().Nominal();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  for (const Vector3d& bad :
       {Vector3d(9, 0, 1), Vector3d(9, 1, -1), Vector3d(-1, 1, 1), Vector3d(9, nan, 1),
        Vector3d(infinity, 1, 1), Vector3d(9, 1, infinity)}) {
    CHECK_THROWS_AS(model.parameters().Apply(bad, &physics), std::invalid_argument);
    CHECK(physics.world.gravity == 10.4);
  }
  CHECK_THROWS_AS(model.parameters().Apply(Eigen::Vector2d(9, 1), &physics), std::invalid_argument);
  CHECK_THROWS_WITH(model.parameters().Apply(Vector3d(9, -3, 1), &physics),
                    Catch::Contains("mass/pole") && Catch::Contains("-3"));
  CHECK_NOTHROW(model.parameters().Apply(Vector3d(0, 1, 1), &physics));  // weightless is physical
}

TEST_CASE("an unknown parameter is answered with the nearest known one") {
  const RobotDescription robot = LoadPendulum("robot.toml");
  CHECK_THROWS_WITH(Model(WithParameters(robot, {"mass/pol"})),
                    Catch::Contains("'mass/pol'") && Catch::Contains("'mass/pole'"));
  CHECK_THROWS_WITH(Model(WithParameters(robot, {"gravty"})), Catch::Contains("'gravity'"));
  CHECK_THROWS_WITH(Model(WithParameters(robot, {"contact/stiffness"})),
                    Catch::Contains("[simulation.contact]"));
  CHECK_THROWS_WITH(Model(WithParameters(robot, {"limit/damping"})),
                    Catch::Contains("[simulation.limit]"));
}

TEST_CASE("a parameter of what is fixed to a link is told to be that link's, with its line") {
  const auto complaint = [](const std::string& name) {
    const std::string toml = Replaced(kZooToml, "name = \"mass/thigh\"", "name = \"" + name + "\"");
    const RobotFolder folder(kZooUrdf,
                             Replaced(toml, "\"mass/thigh\" = [0.9", "\"" + name + "\" = [0.9"));
    const RobotDescription robot = LoadRobot(folder.path());
    try {
      Model{robot};
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  CHECK_THAT(complaint("mass/foot"),
             Catch::Contains("/robot.toml:60:8: [[parameter]]: the simulator has no parameter "
                             "'mass/foot': foot is fixed to slider: use mass/slider"));
  CHECK_THAT(complaint("com/foot/z"),
             Catch::EndsWith(": foot is fixed to slider: use com/slider/z"));
  CHECK_THAT(complaint("friction/weld"), Catch::EndsWith(": weld is a fixed joint"));
  CHECK_THAT(complaint("mass/thight"), Catch::Contains("/robot.toml:60:8: ") &&
                                           Catch::EndsWith("the nearest is 'mass/thigh'"));
}

TEST_CASE("a parameter with a wildcard is one number for all that it covers but what is named") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/quadruped"));
  const RobotDescription set = Describe(
      robot, {"mass/*_thigh", "friction/front_*", "friction/front_left_knee", "inertia/*_calf/xx"},
      Eigen::Vector4d(1.3, 0.4, 0.7, 0.1));
  const RobotDescription one_by_one =
      Describe(robot, {"inertia/front_left_calf/xx", "inertia/rear_right_calf/xx"},
               Eigen::Vector2d(0.1, 0.1));
  for (size_t i = 1; i < robot.links.size(); ++i) {
    const std::string& name = robot.links[i].name;
    const bool thigh = name.ends_with("_thigh"), calf = name.ends_with("_calf");
    const double factor = 1.3 / robot.links[i].mass;
    CHECK(set.links[i].mass == (thigh ? 1.3 : robot.links[i].mass));
    if (thigh) CHECK(set.links[i].inertia.isApprox(factor * robot.links[i].inertia, 1e-14));
    CHECK((set.links[i].inertia == robot.links[i].inertia) == !(thigh || calf));
    if (name == "front_left_calf" || name == "rear_right_calf")
      CHECK(set.links[i].inertia.isApprox(one_by_one.links[i].inertia, 1e-14));
  }
  for (size_t i = 4; i < robot.joints.size(); ++i) {
    const std::string& name = robot.joints[i].name;
    const double covered = name == "front_left_knee" ? 0.7 : 0.4;
    CHECK(set.joints[i].dynamics.friction == (name.starts_with("front_") ? covered : 0.2));
  }
  CHECK_THROWS_WITH(Model(WithParameters(robot, {"mass/*_hip", "mass/front_*"})),
                    Catch::Contains("'mass/*_hip' and 'mass/front_*' both give"));
  CHECK_THROWS_WITH(Model(WithParameters(robot, {"*/front_left_hip"})),
                    Catch::Contains("one number cannot be both"));
  CHECK_THROWS_WITH(Model(WithParameters(robot, {"contact/*"})),
                    Catch::Contains("one number cannot be both"));
  // of the base's, which has no effect, nobody speaks
  CHECK_NOTHROW(Model(WithParameters(robot, {"mass/*"})));
  CHECK_THROWS_WITH(Model(WithParameters(robot, {"mass/*_arm"})),
                    Catch::Contains("has no parameter 'mass/*_arm'"));
}

TEST_CASE("what is frozen may have a wildcard, too, and who is named in full keeps its own value") {
  RobotDescription robot =
      WithParameters(LoadRobot(SourceFile("robots/quadruped")), {"armature/rear_left_hip"});
  robot.frozen = {{"armature/*_hip", 0.02}, {"armature/front_left_hip", 0.03}};
  const RobotDescription set = Model(robot).Describe(VectorXd::Constant(1, 0.04));
  for (size_t i = 4; i < robot.joints.size(); ++i) {
    const std::string& name = robot.joints[i].name;
    const double hip = name == "rear_left_hip" ? 0.04 : name == "front_left_hip" ? 0.03 : 0.02;
    CHECK(set.joints[i].dynamics.armature == (name.ends_with("_hip") ? hip : 0.01));
  }
}

TEST_CASE("the base's mass is a parameter without any effect") {
  Simulator with(WithParameters(LoadPendulum("robot.toml"), {"mass/base"}));
  Simulator without(WithParameters(LoadPendulum("robot.toml"), {}));
  with.SetParameters(VectorXd::Constant(1, 1e3));
  for (Simulator* simulator : {&with, &without}) {
    simulator->SetState(VectorXd::Ones(1), VectorXd::Ones(1));
    simulator->Step(VectorXd::Ones(1), 0.5);
  }
  CHECK(with.q() == without.q());
  CHECK_THROWS_AS(with.SetParameters(VectorXd::Zero(1)), std::invalid_argument);
}

TEST_CASE("a link is stretched with all that is on it") {
  RobotDescription tree = MakeTree();
  const RobotDescription longer =
      Describe(tree, {"length/upper", "length/lower"}, Eigen::Vector2d(1.2, 0.3));
  const double upper = 1.2 / tree.joints[2].origin.norm();
  CHECK(longer.joints[2].origin.isApprox(upper * tree.joints[2].origin, 1e-14));
  CHECK(longer.links[2].center_of_mass.isApprox(upper * tree.links[2].center_of_mass, 1e-14));
  CHECK(longer.links[2].inertia.isApprox(upper * upper * tree.links[2].inertia, 1e-14));
  CHECK(longer.links[2].mass == tree.links[2].mass);
  const double lower = 0.3 / (2 * tree.links[3].center_of_mass.norm());
  CHECK(longer.links[3].center_of_mass.isApprox(lower * tree.links[3].center_of_mass, 1e-14));
  CHECK(longer.joints[1].origin.isApprox(tree.joints[1].origin, 1e-14));
  tree.links[4].center_of_mass.setZero();
  CHECK_THROWS_WITH(Describe(tree, {"length/arm"}, VectorXd::Ones(1)),
                    Catch::Contains("no length"));
}

TEST_CASE("log-Cholesky coordinates reach inertias that a body can have, and no others") {
  const RobotDescription tree = MakeTree();
  std::vector<std::string> paths;
  for (const char* entry : {"xx", "yy", "zz", "xy", "xz", "yz"})
    paths.push_back(std::string("inertia/upper/") + entry);
  const Matrix3d nominal = tree.links[2].inertia;
  CHECK(Describe(tree, paths, VectorXd::Zero(6)).links[2].inertia.isApprox(nominal, 1e-13));
  const auto moments = [](const Matrix3d& i) -> Matrix3d {
    return i.trace() / 2 * Matrix3d::Identity() - i;
  };
  const Matrix3d root = moments(nominal).llt().matrixL();
  Random random(3);
  for (int i = 0; i < 100; ++i) {
    VectorXd x(6);
    for (double& entry : x) entry = random.Normal();
    const Matrix3d inertia = Describe(tree, paths, x).links[2].inertia;
    Matrix3d c = Matrix3d::Zero();
    c.diagonal() = x.head(3).array().exp();
    c(1, 0) = x[3], c(2, 0) = x[4], c(2, 1) = x[5];
    CHECK(moments(inertia).isApprox(root * c * c.transpose() * root.transpose(), 1e-10));
    const Vector3d principal = Eigen::SelfAdjointEigenSolver<Matrix3d>(inertia).eigenvalues();
    CHECK(principal(0) > 0);
    CHECK(principal(2) < principal(0) + principal(1));
  }
  CHECK_THROWS_AS(Describe(tree, paths, VectorXd::Constant(6, 800)), std::invalid_argument);
}

TEST_CASE("every kind of parameter arrives where it belongs, in any order, frozen or not") {
  RobotDescription tree = MakeTree();
  tree.simulation.contact = {1e4, 100, 0.8, 0.1};
  tree.simulation.stop = {1e3, 10};
  const std::vector<std::pair<std::string, double>> values = {{"gravity", 3},
                                                              {"mass/lower", 0.9},
                                                              {"com/lower/x", 0.11},
                                                              {"com/lower/z", -0.2},
                                                              {"inertia/lower", 2},
                                                              {"length/upper", 0.8},
                                                              {"armature/elbow", 0.07},
                                                              {"damping/elbow", 0.3},
                                                              {"friction/rail", 4},
                                                              {"stiffness/other", 5},
                                                              {"rest/other", -0.4},
                                                              {"gain/shoulder", 0.9},
                                                              {"delay/shoulder", .01},
                                                              {"sensor_delay/rail", .004},
                                                              {"sensor_bias/elbow", -.02},
                                                              {"no_load_speed/rail", 9},
                                                              {"contact/stiffness", 2e4},
                                                              {"contact/damping", 50},
                                                              {"contact/friction", 1.1},
                                                              {"limit/stiffness", 500},
                                                              {"limit/damping", 3}};
  std::vector<std::string> paths;
  VectorXd physical(values.size());
  for (size_t i = 0; i < values.size(); ++i) {
    paths.push_back(values[i].first);
    physical[static_cast<Eigen::Index>(i)] = values[i].second;
  }
  const RobotDescription robot = Describe(tree, paths, physical);
  CHECK(robot.simulation.gravity == 3);
  CHECK(robot.links[3].mass == Approx(0.9).epsilon(1e-15));
  CHECK(robot.links[3].center_of_mass.isApprox(Vector3d(0.11, 0.04, -0.2), 1e-14));
  CHECK(robot.links[3].inertia.isApprox(2 * 0.9 / 0.5 * tree.links[3].inertia, 1e-13));
  CHECK(robot.joints[2].origin.norm() == Approx(0.8));
  CHECK(robot.joints[2].dynamics.armature == 0.07);
  CHECK(robot.joints[2].dynamics.damping == 0.3);
  CHECK(robot.joints[0].dynamics.friction == 4);
  CHECK(robot.joints[3].dynamics.stiffness == 5);
  CHECK(robot.joints[3].dynamics.rest == -0.4);
  CHECK(robot.joints[1].dynamics.motor_gain == 0.9);
  CHECK(robot.joints[1].dynamics.delay == 0.01);
  CHECK(robot.joints[0].dynamics.sensor_delay == 0.004);
  CHECK(robot.joints[2].dynamics.sensor_bias == -0.02);
  CHECK(robot.joints[0].dynamics.no_load_speed == Approx(9).epsilon(1e-15));
  CHECK(std::isinf(robot.joints[1].dynamics.no_load_speed));
  CHECK(robot.simulation.contact->stiffness == 2e4);
  CHECK(robot.simulation.contact->damping == 50);
  CHECK(robot.simulation.contact->friction == 1.1);
  CHECK(robot.simulation.stop->stiffness == 500);
  CHECK(robot.simulation.stop->damping == 3);

  // Backwards, and frozen instead of uncertain: the same bits of mass matrix and bias.
  RobotDescription frozen = WithParameters(tree, {});
  for (const auto& [path, value] : values) frozen.frozen.push_back({path, value});
  std::reverse(paths.begin(), paths.end());
  Simulator backwards(WithParameters(tree, paths)), fixed(frozen);
  backwards.SetParameters(physical.reverse());
  const VectorXd q = Eigen::Vector4d(0.1, 1, -1, 2), v = Eigen::Vector4d(0.5, -1, 2, 1);
  backwards.SetState(q, v);
  fixed.SetState(q, v);
  CHECK(backwards.MassMatrix() == fixed.MassMatrix());
  CHECK(backwards.Acceleration(q) == fixed.Acceleration(q));
}

TEST_CASE("hidden parameters lie in their ranges and depend on the seed alone") {
  const RobotDescription description = LoadPendulum("robot.toml");
  VectorXd sum = VectorXd::Zero(3);
  for (uint64_t seed = 0; seed < 1000; ++seed) {
    const VectorXd truth = HiddenParameters(description, seed);
    REQUIRE(truth.size() == 3);
    CHECK((truth.array() >= Eigen::Array3d(9, 0.9, 0.9)).all());
    CHECK((truth.array() <= Eigen::Array3d(11, 1.1, 1.1)).all());
    CHECK(truth == HiddenParameters(description, seed));
    CHECK(truth != HiddenParameters(description, seed + 1));
    sum += truth;
  }
  CHECK(sum[0] / 1000 == Approx(10).margin(0.1));  // 5 standard errors
  CHECK(sum[1] / 1000 == Approx(1).margin(0.01));
  CHECK(sum[2] / 1000 == Approx(1).margin(0.01));

  RobotDescription fewer = description;
  fewer.virtual_robot.hidden = {{"length/pole", 0.9, 1.1}};
  CHECK(HiddenParameters(fewer, 4) ==
        Eigen::Vector3d(10.4, 1.04, HiddenParameters(description, 4)[2]));
}

}  // namespace plumb
