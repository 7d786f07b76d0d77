#include <catch2/catch.hpp>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "dashboard/history.h"
#include "dashboard/posterior_json.h"
#include "dashboard/prediction.h"
#include "dashboard/robot_json.h"
#include "robot/kinematics.h"
#include "sim/view/scene_update.h"

namespace plumb {
namespace {

using nlohmann::json;

RobotDescription Robot(const std::string& name) {
  const char* const source = std::getenv("PLUMBLINE_SOURCE");
  return LoadRobot(std::string(source ? source : ".") + "/robots/" + name);
}

robot_state_t StateOf(const Simulator& simulator, int64_t sequence, double period, double effort) {
  robot_state_t state{};
  state.sequence = sequence;
  state.utime = 1'700'000'000'000'000 + static_cast<int64_t>(1e6 * period * sequence);
  state.num_positions = state.num_velocities = static_cast<int32_t>(simulator.q().size());
  state.q.assign(simulator.q().begin(), simulator.q().end());
  state.v.assign(simulator.v().begin(), simulator.v().end());
  state.effort = {effort};
  return state;
}

/// A robot that is the simulator with these parameters, pushed by changing efforts.
std::optional<OneStepPrediction::Predicted> Follow(const RobotDescription& robot,
                                                   OneStepPrediction& prediction,
                                                   const Eigen::VectorXd& truth,
                                                   int64_t lost = -1) {
  constexpr double kPeriod = 0.005;
  Simulator simulator(robot);
  simulator.SetParameters(truth);
  simulator.SetState(Eigen::VectorXd::Constant(1, 0.5), Eigen::VectorXd::Zero(1));
  double effort = 0;
  for (int64_t i = 0; i < 40; ++i) {
    if (i != lost) prediction.OnState(StateOf(simulator, i, kPeriod, effort));
    effort = 0.1 * static_cast<double>(i % 7);
    simulator.Step(Eigen::VectorXd::Constant(1, effort), kPeriod);
  }
  return prediction.Predict();
}

TEST_CASE("the prediction of one control step is right where the simulator is") {
  const RobotDescription robot = Robot("pendulum");
  const Eigen::Vector3d truth(9.9, 1.3, 0.8);
  OneStepPrediction prediction(robot);
  auto predicted = Follow(robot, prediction, truth);
  REQUIRE(predicted);
  CHECK(predicted->sequence == 39);
  CHECK(std::abs(predicted->q[0] - predicted->q_measured[0]) > 1e-3);  // of the prior's mean
  prediction.SetParameters(truth);
  predicted = Follow(robot, prediction, truth);
  REQUIRE(predicted);
  CHECK(predicted->q[0] == Approx(predicted->q_measured[0]).margin(1e-12));
  CHECK(json::parse(predicted->Json())["q"] == json{predicted->q[0]});
}

TEST_CASE("nothing is predicted over a state that is missing, restarted or not a number") {
  const RobotDescription robot = Robot("pendulum");
  const Eigen::Vector3d truth(9.9, 1.3, 0.8);
  OneStepPrediction prediction(robot);
  CHECK_FALSE(prediction.Predict());
  CHECK_FALSE(Follow(robot, prediction, truth, 36));
  CHECK(Follow(robot, prediction, truth));
  Simulator simulator(robot);
  robot_state_t state = StateOf(simulator, 40, 0.005, std::nan(""));
  prediction.OnState(state);
  CHECK_FALSE(prediction.Predict());
  state = StateOf(simulator, 41, 0.005, 0);
  state.restarted = true;
  prediction.OnState(state);
  CHECK_FALSE(prediction.Predict());
  state.q = {1, 2, 3};
  prediction.OnState(state);
  CHECK_FALSE(prediction.Predict());
}

TEST_CASE("a posterior's quantiles are those of its draws, of a mixture, too") {
  const RobotDescription robot = Robot("pendulum");
  const ParameterDistribution prior = ParameterDistribution::Prior(robot);
  ParameterDistribution posterior = prior;
  posterior.iteration = 3;
  Gaussian other = posterior.mixture.components[0];
  other.mean(1) += 1;
  other.covariance *= 0.01;
  posterior.mixture.components[0].covariance *= 0.01;
  posterior.mixture.components.push_back(other);
  posterior.mixture.weights = {0.75, 0.25};
  const json read = json::parse(PosteriorJson(posterior, prior, 5));
  CHECK(read["iteration"] == 3);
  CHECK(read["utime"] == 5);
  REQUIRE(read["parameters"].size() == 3);
  Random random(7);
  std::vector<double> masses;
  for (int i = 0; i < 20'000; ++i) masses.push_back(posterior.Sample(random)(1));
  std::ranges::sort(masses);
  const json& mass = read["parameters"][1];
  const double probabilities[] = {.025, .25, .5, .75, .975};
  for (size_t i = 0; i < 5; ++i) {
    if (i == 3) continue;  // between the two components, where draws are few
    const double drawn = masses[static_cast<size_t>(probabilities[i] * 20'000)];
    CHECK(mass["quantiles"][i].get<double>() == Approx(drawn).epsilon(0.01));
  }
  CHECK(mass["mean"].get<double>() == Approx(posterior.Mean()(1)));
  CHECK(mass["prior_sd"].get<double>() == Approx(prior.Sd()(1)));
  CHECK(mass["determined"] == false);  // two far apart
  CHECK(read["parameters"][0]["determined"] == true);
  CHECK(read["samples"].size() == kPosteriorDraws);
  CHECK(read["samples"][0].size() == 3);
}

TEST_CASE("a picture has every solid where the robot's kinematics have it") {
  const RobotDescription robot = Robot("hopper");
  const SceneUpdate scene(robot);
  const Eigen::VectorXd q = Eigen::VectorXd::LinSpaced(robot.num_positions(), 0.1, 0.6);
  const json read = json::parse(scene.Json(1'500'000, q, &q));
  REQUIRE(read["entities"].size() == 3);
  CHECK(read["entities"][0]["id"] == "ground");
  CHECK(read["entities"][1]["timestamp"] == json{{"sec", 1}, {"nsec", 500'000'000}});
  const json &drawn = read["entities"][1], &ghost = read["entities"][2];
  CHECK(ghost["cylinders"][0]["color"]["a"].get<double>() < 1);
  size_t spheres = 0, cylinders = 0;
  const std::vector<Pose> poses = LinkPoses(robot, q);
  const auto shapes = ShapesOf(robot);
  for (size_t link = 0; link < poses.size(); ++link) {
    for (const Shape& shape : shapes[link]) {
      if (shape.type == Shape::Type::kSphere) ++spheres;
      if (shape.type != Shape::Type::kCapsule && shape.type != Shape::Type::kCylinder) continue;
      const json& pose = drawn["cylinders"][cylinders++]["pose"];
      const Eigen::Vector3d center = poses[link].position + poses[link].rotation * shape.position;
      CHECK(pose["position"]["x"].get<double>() == Approx(center.x()).margin(1e-12));
      CHECK(pose["position"]["z"].get<double>() == Approx(center.z()).margin(1e-12));
      const Eigen::Quaterniond turn(pose["orientation"]["w"], pose["orientation"]["x"],
                                    pose["orientation"]["y"], pose["orientation"]["z"]);
      const Eigen::Matrix3d axes = poses[link].rotation * shape.rotation;
      CHECK((turn.toRotationMatrix() - axes).norm() < 1e-9);
      if (shape.type == Shape::Type::kCapsule) spheres += 2;
    }
  }
  CHECK(cylinders > 0);
  CHECK(drawn["cylinders"].size() == cylinders);
  CHECK(drawn["spheres"].size() == spheres);
  // Without a prediction the one that was drawn goes.
  const json alone = json::parse(scene.Json(1'500'000, q));
  CHECK(alone["entities"].size() == 2);
  CHECK(alone["deletions"][0]["id"] == "prediction");
  CHECK(json::parse(SceneUpdate::Schema())["title"] == "foxglove.SceneUpdate");
}

TEST_CASE(
    "whoever looks from the frame \"robot\" goes with it along the ground, which never ends") {
  const RobotDescription hopper = Robot("hopper"), pendulum = Robot("pendulum");
  CHECK(json::parse(SceneUpdate::FrameSchema())["title"] == "foxglove.FrameTransform");
  Eigen::VectorXd q = Eigen::VectorXd::Zero(hopper.num_positions());
  q[0] = 20.8, q[1] = 0.3, q[2] = 0.1;  // it has hopped away, is in the air, leans
  const SceneUpdate scene(hopper);
  const json frame = json::parse(scene.FrameJson(1'500'000, q));
  CHECK(frame["parent_frame_id"] == "world");
  CHECK(frame["child_frame_id"] == "robot");
  CHECK(frame["timestamp"] == json{{"sec", 1}, {"nsec", 500'000'000}});
  CHECK(frame["translation"]["x"].get<double>() == Approx(20.8).margin(0.5));
  CHECK(frame["translation"]["z"] == 0);
  CHECK(frame["rotation"] == json{{"x", 0}, {"y", 0}, {"z", 0}, {"w", 1}});
  const json ground = json::parse(scene.Json(1'500'000, q))["entities"][0];
  CHECK(ground["cubes"][0]["pose"]["position"]["x"] == frame["translation"]["x"]);
  // What stays where it is has a frame that does.
  const SceneUpdate swings(pendulum);
  CHECK(json::parse(swings.FrameJson(0, Eigen::VectorXd::Constant(1, 0.3))) ==
        json::parse(swings.FrameJson(0, Eigen::VectorXd::Constant(1, 2.3))));
}

TEST_CASE("the page is told of joints, coordinates, priors, and whether it may arm") {
  const RobotDescription robot = Robot("hopper");
  const json read = json::parse(RobotJson(robot, ""));
  CHECK(read["name"] == "hopper");
  CHECK(read["joints"].size() == robot.joints.size());
  CHECK(read["coordinates"].size() == static_cast<size_t>(robot.num_positions()));
  CHECK(read["velocities"].size() == static_cast<size_t>(robot.num_velocities()));
  CHECK(read["parameters"][0]["prior_mean"] == robot.parameters[0].mean);
  CHECK(read["task"]["name"] == "hopper");
  CHECK(read["may_control"] == true);
  CHECK(json::parse(RobotJson(robot, "no \"token\""))["why_not"] == "no \"token\"");
}

TEST_CASE("a history has a bound, in messages and in bytes") {
  History history;
  const auto add = [&](uint64_t order, std::string text) {
    history.Add({order, 0, {}, order, std::make_shared<const std::string>(std::move(text))});
  };
  for (uint64_t i = 0; i < 1000; ++i) add(i, std::to_string(i));
  CHECK(history.entries().size() == History::kMaxMessages);
  CHECK(*history.entries().back().json == "999");
  for (uint64_t i = 0; i < 10; ++i)
    add(i, std::string(size_t{3} << 20, static_cast<char>('a' + i)));
  CHECK(history.entries().size() == 5);
  History steps;
  for (int64_t i = 0; i < 2000; ++i)
    steps.Add({static_cast<uint64_t>(i), 0, History::Step{i / 100, i % 100}, 0,
               std::make_shared<const std::string>(std::to_string(i))});
  CHECK(steps.entries().size() == 2000);
}

}  // namespace
}  // namespace plumb
