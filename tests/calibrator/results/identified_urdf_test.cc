#include "calibrator/results/identified_urdf.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <functional>

#include "common/config.h"
#include "robot/urdf/xml_edits.h"
#include "sim/model.h"
#include "tests/robot/zoo.h"

namespace plumb {
namespace {

using Catch::Contains;
using Coordinate = ParameterDescription::Coordinate;

struct NewValue {
  std::string name;
  double value;
};

std::string Source(const std::string& robot) {
  return std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/" + robot;
}

std::string Text(const std::string& file) { return ReadFile(file); }

/// The robot with these parameters, none else.
RobotDescription WithParameters(RobotDescription robot, const std::vector<NewValue>& values) {
  robot.parameters.clear();
  robot.virtual_robot.hidden.clear();
  for (const auto& [name, value] : values)
    robot.parameters.push_back({name, "u", Coordinate::kLinear, value, 1});
  return robot;
}

Eigen::VectorXd Values(const std::vector<NewValue>& values) {
  Eigen::VectorXd physical(values.size());
  for (size_t i = 0; i < values.size(); ++i)
    physical(static_cast<Eigen::Index>(i)) = values[i].value;
  return physical;
}

std::string Identified(const RobotDescription& robot, const std::vector<NewValue>& values) {
  const Eigen::VectorXd mean = Values(values);
  return IdentifiedUrdf(WithParameters(robot, values), mean,
                        Eigen::VectorXd::Constant(mean.size(), 0.25));
}

template <class A, class B>
void CheckSame(const A& a, const B& b) {
  CHECK((a - b).cwiseAbs().maxCoeff() <= 1e-12 * (1 + b.cwiseAbs().maxCoeff()));
}

/// Loads the new URDF with the old robot.toml, and checks that this is the robot that the simulator
/// has with these parameters.
/// @return the new URDF.
std::string CheckPhysics(const std::string& urdf, const std::string& toml,
                         const std::vector<NewValue>& values) {
  const RobotFolder original(urdf, toml);
  const RobotDescription robot = LoadRobot(original.path());
  const RobotDescription expected = Model(WithParameters(robot, values)).Describe(Values(values));
  const std::string text = Identified(robot, values);
  INFO(text);
  const RobotFolder folder(text, toml);
  const RobotDescription found = LoadRobot(folder.path());
  REQUIRE(found.links.size() == expected.links.size());
  bool changed = false;
  for (size_t i = 1; i < found.links.size(); ++i) {
    const LinkDescription &is = found.links[i], &should = expected.links[i];
    INFO(is.name);
    CHECK(std::abs(is.mass - should.mass) <= 1e-12 * should.mass);
    CheckSame(is.center_of_mass, should.center_of_mass);
    CheckSame(is.inertia, should.inertia);
    changed = changed || is.mass != robot.links[i].mass ||
              is.center_of_mass != robot.links[i].center_of_mass ||
              is.inertia != robot.links[i].inertia;
  }
  for (size_t i = 0; i < found.joints.size(); ++i) {
    const JointDescription &is = found.joints[i], &should = expected.joints[i];
    INFO(is.name);
    CheckSame(is.origin, should.origin);
    CHECK(is.rotation == robot.joints[i].rotation);
    CHECK(is.lower == should.lower);
    CHECK(is.upper == should.upper);
    CHECK(is.effort_limit == should.effort_limit);
    // Where robot.toml overrides the URDF, the comment has the value for robot.toml.
    const auto check_dynamics = [&](const std::string& kind, double now, double expected_now,
                                    double before) {
      const bool frozen = std::any_of(robot.frozen.begin(), robot.frozen.end(), [&](const auto& f) {
        return f.name == kind + "/" + is.name;
      });
      if (frozen || text.find("name = \"" + kind + "/" + is.name + "\"") != std::string::npos) {
        CHECK(now == before);
      } else {
        CHECK(now == expected_now);
        changed = changed || now != before;
      }
    };
    check_dynamics("damping", is.dynamics.damping, should.dynamics.damping,
                   robot.joints[i].dynamics.damping);
    check_dynamics("friction", is.dynamics.friction, should.dynamics.friction,
                   robot.joints[i].dynamics.friction);
  }
  // Contact, too, is in the same places: of spheres in the description, as the simulator has them.
  const RobotDescription touching =
      Model(WithParameters(found, {{"gravity", 9}})).Describe(Values({{"gravity", 9}}));
  for (size_t i = 1; i < found.links.size() && found.simulation.contact; ++i) {
    REQUIRE(touching.links[i].collisions.size() == expected.links[i].collisions.size());
    for (size_t k = 0; k < expected.links[i].collisions.size(); ++k) {
      CheckSame(touching.links[i].collisions[k].position, expected.links[i].collisions[k].position);
      CheckSame(touching.links[i].collisions[k].size, expected.links[i].collisions[k].size);
    }
  }
  CHECK(changed);
  return text;
}

std::string CheckPhysics(const std::string& robot, const std::vector<NewValue>& values) {
  return CheckPhysics(Text(Source(robot) + "/robot.urdf"), Text(Source(robot) + "/robot.toml"),
                      values);
}

/// Lines that differ, the comment aside.
int ChangedLines(const std::string& before, const std::string& after) {
  const size_t end = after.find("-->") + 3, begin = after.find("<!--");
  std::string rest = after;
  rest.erase(begin - 1, end - begin + 1);
  std::istringstream a(before), b(rest);
  int changed = 0;
  for (std::string x, y; std::getline(a, x);) {
    REQUIRE(std::getline(b, y));
    changed += x != y;
  }
  return changed;
}

TEST_CASE("the URDF of an identified robot has the physics of the simulator that explains it") {
  CheckPhysics("pendulum", {{"gravity", 9.3}, {"mass/pole", 0.93}, {"length/pole", 1.07}});
  CheckPhysics(
      "pendulum",
      {{"com/pole/x", 0.01}, {"com/pole/z", 0.47}, {"inertia/pole", 1.3}, {"length/pole", 0.9}});
  CheckPhysics("double_pendulum", {{"length/upper", 0.71},
                                   {"mass/lower", 0.5},
                                   {"inertia/upper/xx", 0.2},
                                   {"inertia/lower/yz", -0.1},
                                   {"length/lower", 0.55}});
  CheckPhysics("cartpole", {{"mass/cart", 1.1},
                            {"mass/pole", 0.13},
                            {"length/pole", 1.2},
                            {"damping/hinge", 0.003},
                            {"friction/cart", 0.4},
                            {"damping/cart", 0.1}});
  CheckPhysics("hopper", {{"mass/torso", 3.1},
                          {"length/thigh", 0.5},
                          {"length/leg", 0.45},
                          {"length/foot", 0.2},
                          {"com/torso/x", -0.01},
                          {"inertia/leg", 0.8},
                          {"contact/friction", 1.5}});
}

TEST_CASE("in any order and alone, parameters give the same") {
  CheckPhysics("hopper",
               {{"inertia/leg", 0.8}, {"length/leg", 0.45}, {"com/leg/z", -0.2}, {"mass/leg", 3}});
  CheckPhysics("hopper",
               {{"mass/leg", 3}, {"com/leg/z", -0.2}, {"length/leg", 0.45}, {"inertia/leg", 0.8}});
  CHECK_THAT(CheckPhysics("pendulum", {{"friction/pivot", 0.1}, {"damping/pivot", 0.2}}),
             Contains("\n    <dynamics friction=\"0.1\" damping=\"0.2\"/>\n"));
  // The hinge's damping is robot.toml's.
  const std::string text =
      CheckPhysics("cartpole", {{"friction/hinge", 0.01}, {"damping/hinge", 0.02}});
  CHECK_THAT(text, Contains("\n    <dynamics friction=\"0.01\"/>\n") &&
                       Contains("name = \"damping/hinge\""));
}

TEST_CASE("one number for several parts is written to each, but to what is named in full") {
  CheckPhysics("hopper", {{"mass/[lt]*", 2.5}, {"length/*", 0.6}, {"mass/leg", 2}});
  CHECK_THAT(CheckPhysics("cartpole", {{"friction/*", 0.3}, {"friction/cart", 0.1}}),
             Contains("<dynamics friction=\"0.3\"/>"));
  // Of one of them robot.toml has it: then that is where it goes.
  const RobotDescription cartpole = LoadRobot(Source("cartpole"));
  CHECK_THAT(Identified(cartpole, {{"damping/*", 0.02}}),
             Contains("name = \"damping/*\"") && !Contains("<dynamics damping"));
}

TEST_CASE("links welded together, planar and floating joints: the physics is right, too") {
  // foot is welded to slider at a right angle, and carries all of its mass.
  const std::vector<NewValue> values{{"mass/slider", 0.2},      {"com/slider/x", 0.01},
                                     {"inertia/slider", 1.4},   {"length/thigh", 0.5},
                                     {"inertia/thigh/xy", 0.3}, {"mass/carriage", 2.5},
                                     {"length/slider", 0.5}};
  const RobotFolder original(kZooUrdf, kZooToml);
  std::vector<NewValue> known;
  const RobotDescription robot = LoadRobot(original.path());
  for (const NewValue& value : values) {  // those that this robot has
    try {
      Model(WithParameters(robot, {value}));
      known.push_back(value);
    } catch (const std::invalid_argument&) {
    }
  }
  REQUIRE(known.size() >= 6);
  const std::string text = CheckPhysics(kZooUrdf, kZooToml, known);
  CHECK_THAT(text, Contains("<mesh filename=\"carriage.stl\"/>"));

  // Two bodies with mass in one link: the first takes it all.
  std::string welded = kZooUrdf;
  const size_t slider = welded.find("<link name=\"slider\"/>");
  welded.replace(
      slider, 21,
      R"(<link name="slider"><inertial><origin xyz="0 0.1 0" rpy="0.3 0 0.2"/><mass value='0.3'/>
    <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial></link>)");
  CheckPhysics(welded, kZooToml,
               {{"mass/slider", 0.5}, {"inertia/slider", 1.2}, {"com/slider/y", 0.02}});
}

TEST_CASE("a link that gets longer takes its contact shapes along") {
  std::string boxed = kZooUrdf;
  const std::string cylinder = R"(<cylinder radius="0.05" length="0.2"/>)";
  boxed.replace(boxed.find(cylinder), cylinder.size(), R"(<box size="0.1 0.08 0.2"/>)");
  CheckPhysics(boxed, kZooToml, {{"length/thigh", 0.5}});
}

TEST_CASE("only the numbers that have changed change") {
  const std::string before = Text(Source("hopper") + "/robot.urdf");
  const RobotDescription robot = LoadRobot(Source("hopper"));
  // mass, and two lines of inertia
  CHECK(ChangedLines(before, Identified(robot, {{"mass/leg", 3}})) == 3);
  CHECK(ChangedLines(before, Identified(robot, {{"com/leg/x", 0.1}})) == 1);
  CHECK(ChangedLines(before, Identified(robot, {{"gravity", 9}})) == 0);
  CHECK(ChangedLines(before, Identified(robot, {{"damping/leg", 3}})) == 0);  // robot.toml's counts
  const Eigen::VectorXd same = Eigen::VectorXd::Constant(1, robot.links[5].mass);
  CHECK(ChangedLines(before, IdentifiedUrdf(WithParameters(robot, {{"mass/leg", same(0)}}), same,
                                            same)) == 0);
}

TEST_CASE("the comment says what was identified, and what belongs into robot.toml") {
  RobotDescription robot = LoadRobot(Source("hopper"));
  robot.name = "hop--per\xc3\xa9";
  const std::string text = Identified(
      robot, {{"mass/leg", 3}, {"armature/leg", 0.9}, {"damping/leg", 0.7}, {"delay/foot", 0.01}});
  CHECK(text.starts_with(
      "<?xml version=\"1.0\"?>\n<!-- Identified by Plumbline from the motion of hop- -per??."));
  const std::string comment = text.substr(0, text.find("-->"));
  CHECK_THAT(comment, Contains("mass/leg = 3 u, sd 0.25 u"));
  for (const char* table : {"name = \"armature/leg\"\n       frozen = true\n       mean = 0.9",
                            "name = \"damping/leg\"\n       frozen = true\n       mean = 0.7",
                            "name = \"delay/foot\"\n       frozen = true\n       mean = 0.01"}) {
    CHECK_THAT(comment, Contains(table));
  }
}

TEST_CASE("a value that is not physical, or a robot that has changed, is an error") {
  const RobotDescription robot = LoadRobot(Source("cartpole"));
  CHECK_THROWS_WITH(IdentifiedUrdf(WithParameters(robot, {{"mass/pole", 1}}),
                                   Eigen::VectorXd::Constant(1, -1), Eigen::VectorXd::Ones(1)),
                    Contains("mass/pole"));
  CHECK_THROWS_AS(IdentifiedUrdf(WithParameters(robot, {{"mass/pole", 1}}),
                                 Eigen::VectorXd::Ones(2), Eigen::VectorXd::Ones(2)),
                  std::invalid_argument);
  const std::string urdf = Text(Source("cartpole") + "/robot.urdf"),
                    toml = Text(Source("cartpole") + "/robot.toml");
  const RobotFolder folder(urdf, toml);
  const RobotDescription read = LoadRobot(folder.path());
  folder.Write(urdf + "\n", toml);
  CHECK_THROWS_WITH(Identified(read, {{"mass/pole", 1}}), Contains("has changed"));
}

TEST_CASE("attributes are set in any layout, and nothing else moves") {
  const std::string text =
      "\xef\xbb\xbf<?xml version=\"1.0\" encoding='UTF-8'?>\r\n<!-- a='1' \xc3\xa9 -->\r\n"
      "<r a='1'\tb = \"2\">\n\t<!-- \xe2\x82\xac --> \xc3\xa9\t<s a=\"x>y\"   "
      "b\n=\n'3'/><t><u/></t>\n  "
      "<v>\n    <w/>\n  </v>\n</r>\n";
  XmlEdits edits(text);
  const TiXmlElement& r = edits.root();
  edits.SetAttribute(r, "b", "22");
  edits.SetAttribute(r, "c", "new");
  edits.SetAttribute(*r.FirstChildElement("s"), "b", "33");
  edits.SetAttribute(*r.FirstChildElement("s"), "b", "333");
  edits.SetAttribute(*r.FirstChildElement("t")->FirstChildElement("u"), "d", "4");
  edits.AddChild(*r.FirstChildElement("t"), "<x/>");
  edits.AddChild(*r.FirstChildElement("v"), "<y/>");
  edits.AddComment("here");
  CHECK(edits.Print() ==
        "\xef\xbb\xbf<?xml version=\"1.0\" encoding='UTF-8'?>\n<!-- here -->\r\n<!-- a='1' "
        "\xc3\xa9 -->\r\n"
        "<r c=\"new\" a='1'\tb = \"22\">\n\t<!-- \xe2\x82\xac --> \xc3\xa9\t<s a=\"x>y\"   "
        "b\n=\n'333'/><t><x/><u d=\"4\"/></t>\n"
        "  <v>\n    <y/>\n    <w/>\n  </v>\n</r>\n");
  CHECK(XmlEdits(text).Print() == text);
  CHECK_THROWS_AS(XmlEdits("<a"), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
