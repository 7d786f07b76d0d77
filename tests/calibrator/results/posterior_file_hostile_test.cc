#include <catch2/catch.hpp>
#include <functional>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "calibrator/results/posterior_file.h"
#include "common/random.h"
#include "robot/physics_fingerprint.h"
#include "robot/posterior_reader.h"
#include "tests/calibrator/sample_findings.h"
#include "tests/calibrator/synthetic.h"
#include "tests/robot/zoo.h"
#include "tests/temporary_file.h"

namespace plumb {
namespace {

using Catch::Contains;
using nlohmann::json;

std::string Error(const std::string& text, const RobotDescription& robot) {
  const TemporaryFile file(text, ".json");
  try {
    ReadPosterior(file.path(), robot);
  } catch (const std::runtime_error& error) {
    CHECK_THAT(error.what(), Contains(file.path()));
    return error.what();
  }
  return "";
}

TEST_CASE("a posterior that is not this robot's is refused, with the reason") {
  RobotDescription robot = Pendulum();
  const std::string text = PosteriorJson(SampleFindings(robot), robot, {});
  CHECK(Error(text, robot) == "");
  RobotDescription other = robot;
  other.training.updates += 1, other.task.steps += 1, other.parameters[0].mean += 1,
      ++other.fingerprint;
  other.links[1].visuals.clear();
  CHECK(Error(text, other) == "");  // a posterior is about physics
  other = robot, other.name = "reacher";
  CHECK_THAT(Error(text, other), Contains(": robot: is another robot's"));
  other = robot, other.parameters[1].name = "mass/rod";
  CHECK_THAT(Error(text, other), Contains(": names[1]: "));
  other = robot, other.parameters.pop_back();
  CHECK_THAT(Error(text, other), Contains(": names: has 3 entries, expected 2"));
  other = robot, other.parameters[2].unit = "mm";
  CHECK_THAT(Error(text, other), Contains(": units[2]: "));
  other = robot, other.parameters[2].coordinate = ParameterDescription::Coordinate::kLinear;
  CHECK_THAT(Error(text, other), Contains(": coordinates[2].kind: "));
  other = robot, other.links[1].mass *= 1 + 1e-15;
  CHECK_THAT(Error(text, other), Contains(": physics: "));
  CHECK_THAT(Error("", robot), Contains("parse error"));
  CHECK_THROWS_WITH(ReadPosterior("/nowhere/posterior.json", robot),
                    Contains("/nowhere/posterior.json: there is no such file"));
  CHECK_THROWS_WITH(ReadPosterior("/dev/zero", robot), Contains("no such file"));
}

TEST_CASE("bounds of a logit coordinate are part of the posterior") {
  const RobotFolder folder(kZooUrdf, kZooToml);
  RobotDescription robot = LoadRobot(folder.path());
  const std::string text = PosteriorJson(SampleFindings(robot), robot, {});
  CHECK(Error(text, robot) == "");
  robot.parameters[1].upper = 1.3;
  CHECK_THAT(Error(text, robot),
             Contains("coordinates[1].upper: is 1.2, contact/friction has the bound 1.3 now"));
}

TEST_CASE("everything that matters to the motion is in the fingerprint of the physics") {
  const RobotFolder folder(kZooUrdf, kZooToml);
  const RobotDescription robot = LoadRobot(folder.path());
  const std::vector<std::function<void(RobotDescription&)>> changes{
      [](auto& r) { r.links[3].center_of_mass.x() += 1e-9; },
      [](auto& r) { r.links[3].inertia(0, 0) *= 1.0000001; },
      [](auto& r) { r.links[4].collisions.pop_back(); },
      [](auto& r) { r.joints[3].axis = -r.joints[3].axis; },
      [](auto& r) { r.joints[3].dynamics.delay = 0; },
      [](auto& r) { r.joints[3].dynamics.no_load_speed += 1; },
      [](auto& r) { r.frozen[0].value = 0.3; },
      [](auto& r) { r.simulation.substep /= 2; },
      [](auto& r) { r.simulation.contact->friction = 0.9; },
      [](auto& r) { r.simulation.stop.reset(); }};
  for (size_t i = 0; i < changes.size(); ++i) {
    INFO("change " << i);
    RobotDescription other = robot;
    changes[i](other);
    CHECK(PhysicsFingerprint(other) != PhysicsFingerprint(robot));
  }
  CHECK(PhysicsFingerprint(LoadRobot(folder.path())) == PhysicsFingerprint(robot));
}

TEST_CASE("hostile posteriors are refused with file and field") {
  const RobotDescription robot = Pendulum();
  const json good = json::parse(PosteriorJson(SampleFindings(robot), robot, {}));
  const auto spoilt = [&](const std::string& pointer, const json& value) {
    json j = good;
    j[json::json_pointer(pointer)] = value;
    return Error(j.dump(), robot);
  };
  CHECK_THAT(spoilt("/format", "plumbline prior"), Contains(": format: "));
  CHECK_THAT(spoilt("/version", 3), Contains(": version: is 3, this program reads 1 and 2"));
  CHECK_THAT(spoilt("/version", "1"), Contains(": version: is not a number"));
  CHECK_THAT(spoilt("/names", "gravity"), Contains(": names: is not an array"));
  CHECK_THAT(spoilt("/names/0", 7), Contains(": names[0]: is not a string"));
  CHECK_THAT(spoilt("/mixture", 7), Contains(": mixture: is not an object"));
  CHECK_THAT(spoilt("/mixture/means/0/0", 700),
             Contains(": mixture: is too far, or too wide: its moments are beyond 1e+12"));
  CHECK_THAT(spoilt("/mixture/weights", json::array()),
             Contains(": mixture.weights: has 0 entries"));
  CHECK_THAT(spoilt("/mixture/weights", std::vector<double>(100000, 1e-5)),
             Contains(": mixture.weights: has 100000"));
  CHECK_THAT(spoilt("/mixture/weights", {0.7, 0.2}), Contains(": mixture.weights: sum to"));
  CHECK_THAT(spoilt("/mixture/weights", {1.5, -0.5}),
             Contains(": mixture.weights[1]: is not positive"));
  CHECK_THAT(spoilt("/mixture/weights/0", nullptr),
             Contains(": mixture.weights[0]: is not a number"));
  CHECK_THAT(spoilt("/mixture/weights/0", true), Contains(": mixture.weights[0]: is not a number"));
  CHECK_THAT(spoilt("/mixture/means/0", {1, 2}),
             Contains(": mixture.means[0]: has 2 entries, expected 3"));
  CHECK_THAT(spoilt("/mixture/means/0/1", "1"), Contains(": mixture.means[0][1]: is not a number"));
  CHECK_THAT(spoilt("/mixture/means/0/0", 1e9), Contains(": mixture: is too far, or too wide"));
  CHECK_THAT(spoilt("/mixture/covariances", json::array()),
             Contains(": mixture.covariances: has 0 entries, expected 2"));
  CHECK_THAT(spoilt("/mixture/covariances/1/2", {1}),
             Contains(": mixture.covariances[1][2]: has 1 entries, expected 3"));
  CHECK_THAT(spoilt("/mixture/covariances/1/0/1", 5),
             Contains(": mixture.covariances[1]: is not symmetric"));
  CHECK_THAT(spoilt("/mixture/covariances/1/0/0", -1),
             Contains(": mixture.covariances[1]: is not positive definite"));
  CHECK_THAT(Error("[1]", robot), Contains("is not a posterior"));
  CHECK_THAT(Error(std::string(1000000, '['), robot), Contains("nests deeper than 100"));
  for (const char* key : {"format", "version", "robot", "physics", "names", "units", "coordinates",
                          "mixture", "residual", "starts"}) {
    json j = good;
    j.erase(key);
    CHECK_THAT(Error(j.dump(), robot), Contains(std::string(": ") + key + ": is missing"));
  }
}

TEST_CASE("hostile residuals are refused with file and field") {
  const RobotDescription robot = Pendulum();
  Findings findings = SampleFindings(robot);
  findings.starts = {Eigen::Vector2d(1, 2)};
  const json good = json::parse(PosteriorJson(findings, robot, {}));
  REQUIRE(Error(good.dump(), robot) == "");
  const auto spoilt = [&](const std::string& pointer, const json& value) {
    json j = good;
    j[json::json_pointer(pointer)] = value;
    return Error(j.dump(), robot);
  };
  CHECK_THAT(spoilt("/residual", 7), Contains(": residual.draws: ") || Contains(": residual: "));
  CHECK_THAT(spoilt("/residual", json::object()), Contains(": residual.draws: is missing"));
  CHECK_THAT(spoilt("/residual/draws", json::array()), Contains(": residual.draws: has 0 entries"));
  CHECK_THAT(spoilt("/residual/draws/1", {1, 2}),
             Contains(": residual.draws[1]: has 2 entries, expected 3"));
  CHECK_THAT(spoilt("/residual/draws/1/0", nullptr),
             Contains(": residual.draws[1][0]: is not a number"));
  CHECK_THAT(spoilt("/residual/draws/1/0", 1e9), Contains(": residual.draws: is too wide"));
  CHECK_THAT(spoilt("/residual/margin", -1), Contains(": residual.margin: is negative"));
  CHECK(spoilt("/residual/touching", nullptr).empty());  // there is that of the ground
  CHECK_THAT(spoilt("/residual/free", "none"), Contains(": residual.free: is not an object"));
  const std::string touching = "/residual/touching/", path = ": residual.touching.";
  CHECK_THAT(spoilt(touching + "mean", json::array()), Contains(path + "mean: has 0 entries"));
  CHECK_THAT(spoilt(touching + "mean", std::vector<double>(20000, 1)),
             Contains(path + "mean: has 20000 entries"));
  CHECK_THAT(spoilt(touching + "mean", {1, 2, 3}),
             Contains(path + "scale: has 2 entries, expected 3"));
  CHECK_THAT(spoilt(touching + "scale/1", 0), Contains(path + "scale[1]: is not positive"));
  CHECK_THAT(spoilt(touching + "bound/0", -1), Contains(path + "bound[0]: is not positive"));
  CHECK_THAT(spoilt(touching + "bound/0", 3e38),
             Contains(path + "bound[0]: is larger than what a simulator can lack"));
  CHECK_THAT(spoilt(touching + "unknown/0", 2000),
             Contains(path + "unknown[0]: is larger than what a simulator can lack"));
  CHECK_THAT(spoilt(touching + "noise/1/0", -2000),
             Contains(path + "noise[1][0]: is larger than what a simulator can lack"));
  CHECK_THAT(spoilt(touching + "low/0", 1e6), Contains(path + "low: is above high"));
  CHECK_THAT(spoilt(touching + "centres/2", {1}),
             Contains(path + "centres[2]: has 1 entries, expected 2"));
  CHECK_THAT(spoilt(touching + "weights/0", json::array()),
             Contains(path + "weights[0]: has 0 entries, expected 2"));
  CHECK_THAT(spoilt(touching + "weights/1/0", {1, 2}),
             Contains(path + "weights[1][0]: has 2 entries, expected 6"));
  CHECK_THAT(spoilt(touching + "weights/1/0/5", 1e300),
             Contains(path + "weights[1][0][5]: is not finite in single precision"));
  CHECK_THAT(spoilt(touching + "weights/1/0/5", nullptr),
             Contains(path + "weights[1][0][5]: is not a number"));
  CHECK_THAT(spoilt(touching + "noise/0", {1, 2, 3}),
             Contains(path + "noise[0]: has 3 entries, expected 2"));
  CHECK_THAT(spoilt("/starts", 1), Contains(": starts: is not an array"));
  CHECK_THAT(spoilt("/starts/0", {1}), Contains(": starts[0]: has 1 entries, expected 2"));
  CHECK_THAT(spoilt("/starts/0/1", "x"), Contains(": starts[0][1]: is not a number"));
  json j = good;
  j["residual"]["draws"].push_back({0, 0, 0});
  CHECK_THAT(Error(j.dump(), robot), Contains(path + "weights: has 2 entries, expected 3"));
}

TEST_CASE("hostile residuals of contacts are refused with file and field") {
  const RobotDescription robot = Pendulum();
  const json good = json::parse(PosteriorJson(SampleFindings(robot), robot, {}));
  const auto spoilt = [&](const std::string& field, const json& value) {
    json j = good;
    j[json::json_pointer("/residual/" + field)] = value;
    return Error(j.dump(), robot);
  };
  CHECK_THAT(spoilt("ground/bound", std::vector<double>(7, 1)),
             Contains(": residual.ground.bound: has 7 entries"));
  CHECK_THAT(spoilt("ground/bound", {1, 1}), Contains(": residual.ground.weights[0]: has 4"));
  CHECK_THAT(spoilt("ground/noise/3/3", "x"),
             Contains(": residual.ground.noise[3][3]: is not a number"));
  json j = good;
  j["residual"]["touching"] = j["residual"]["ground"] = nullptr;
  CHECK_THAT(Error(j.dump(), robot), Contains(": residual: has no function"));
  j["residual"].erase("stop");
  CHECK_THAT(Error(j.dump(), robot), Contains(": residual.stop: is missing"));
}

TEST_CASE("a posterior that was cut off or has rotten bytes is refused or read, nothing else") {
  const RobotDescription robot = Pendulum();
  Findings findings = SampleFindings(robot);
  findings.samples.conservativeResize(3, 2);
  const std::string text = PosteriorJson(findings, robot, {});
  for (size_t length = 0; length + 2 < text.size(); length += 97)
    CHECK(Error(text.substr(0, length), robot) != "");
  Random random(3, {1});
  int refused = 0;
  for (int i = 0; i < 400; ++i) {
    std::string rotten = text;
    for (int k = 0; k < 3; ++k)
      rotten[random.Bits() % text.size()] = static_cast<char>(random.Bits());
    if (Error(rotten, robot) != "") ++refused;
  }
  CHECK(refused > 200);
}

}  // namespace
}  // namespace plumb
