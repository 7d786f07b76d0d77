#include "robot/contact_pairs.h"

#include <catch2/catch.hpp>

#include "tests/replaced.h"
#include "tests/robot/zoo.h"

namespace plumb {
namespace {

using Catch::Contains;

// The zoo, whose base has a box, whose thigh a capsule and a cylinder, and whose slider a sphere.
RobotDescription WithPairs(const std::string& pairs) {
  const std::string urdf = Replaced(kZooUrdf, "<cylinder radius=\"1\" length=\"0.1\"/>",
                                    "<box size=\"2 2 0.1\"/>"),
                    toml = Replaced(kZooToml, "[simulation.limit]", pairs + "[simulation.limit]");
  return LoadRobot(RobotFolder(urdf, toml).path());
}

std::string Pair(const std::string& first, const std::string& second) {
  return "[[simulation.contact.pair]]\nlinks = [\"" + first + "\", \"" + second + "\"]\n";
}

// Names of the links that touch, in order.
std::vector<std::string> Touching(const RobotDescription& robot) {
  std::vector<std::string> names;
  const ContactPairs found = FindContactPairs(robot);
  for (const auto& [first, second] : found.pairs) {
    const auto name = [&](size_t solid) {
      return robot.links[static_cast<size_t>(found.solids[solid].link)].name;
    };
    names.push_back(name(first) + " " + name(second));
  }
  return names;
}

TEST_CASE("links touch each other where they are named, in either order, but for neighbours") {
  using Names = std::vector<std::string>;
  CHECK(Touching(WithPairs("")).empty());
  CHECK(Touching(WithPairs(Pair("base", "thigh"))) == Names{"base thigh"});
  CHECK(Touching(WithPairs(Pair("thigh", "base"))) == Names{"base thigh"});
  CHECK(Touching(WithPairs(Pair("base", "*"))) == Names{"base thigh", "base slider"});
  CHECK(Touching(WithPairs(Pair("*", "*") + Pair("base", "s*"))) ==
        Names{"base thigh", "base slider"});  // thigh and slider are joined
}

TEST_CASE("a shape is a rounded box") {
  const RobotDescription robot = WithPairs(Pair("base", "*"));
  const ContactPairs found = FindContactPairs(robot);
  REQUIRE(found.solids.size() == 3);
  const auto box = [&](size_t solid) {
    const ContactPairs::Solid& at = found.solids[solid];
    return RoundedBox(robot.links[static_cast<size_t>(at.link)].collisions[at.shape]);
  };
  CHECK(box(0).half == Eigen::Vector3d(1, 1, 0.05));
  CHECK(box(0).radius == 0);
  CHECK(box(1).half == Eigen::Vector3d(0, 0, 0.15));
  CHECK(box(1).radius == 0.04);
  CHECK(box(2).half == Eigen::Vector3d(0, 0, 0));
  CHECK(box(2).radius == 0.03);
}

TEST_CASE("what the base has that nothing touches is said, if links are to touch it") {
  const auto warnings = [](const std::string& pairs) {
    const std::string toml = Replaced(kZooToml, "[simulation.limit]", pairs + "[simulation.limit]"),
                      urdf = Replaced(kZooUrdf, "<link name=\"base\">",
                                      "<link name=\"base\"><collision><geometry><box size=\"1 1 "
                                      "1\"/></geometry></collision>");
    return LoadRobot(RobotFolder(urdf, toml).path()).warnings;
  };
  CHECK(warnings("").size() == 2);  // the thigh's cylinder and mesh
  const std::vector<std::string> with = warnings(Pair("base", "thigh"));
  REQUIRE(with.size() == 3);
  CHECK_THAT(with[2], Contains("robot.urdf:4: link base: a collision cylinder touches nothing"));
}

TEST_CASE("mistakes about pairs are at their lines") {
  const auto refused = [](const std::string& pairs, const std::string& what) {
    INFO(pairs);
    CHECK_THROWS_WITH(WithPairs(pairs), Contains("robot.toml:57") && Contains(what));
  };
  const std::string not_two =
      "are not two links with collision spheres, capsules or boxes that no joint joins";
  refused(Pair("base", "shank"), "links = [\"base\", \"shank\"] " + not_two);
  refused(Pair("base", "carriage"), not_two);  // has no shape
  refused(Pair("thigh", "slider"), not_two);   // neighbours
  refused(Pair("thigh", "thigh"), not_two);
  refused("[[simulation.contact.pair]]\nlinks = [\"base\"]\n", "must name two links");
  refused("[[simulation.contact.pair]]\nlinks = \"base\"\n", "pair[0].links");
  refused("[[simulation.contact.pair]]\nlink = \"base\"\n", "did you mean links?");
  CHECK_THROWS_WITH(WithPairs("[[simulation.contact.pair]]\n"), Contains("pair[0].links"));
  std::string many;
  for (int i = 0; i < 1001; ++i) many += Pair("base", "thigh");
  CHECK_THROWS_WITH(WithPairs(many), Contains("is one of more than 1000"));
}

}  // namespace
}  // namespace plumb
