#include "robot/parameter_kinds.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <set>
#include <string>

namespace plumb {
namespace {

TEST_CASE("every kind of parameter has a name of its own, and a default that robot.toml may give") {
  std::set<std::string> names;
  constexpr JointDynamics kDefault;
  for (const JointParameterKind& kind : kJointParameterKinds) {
    INFO(kind.name);
    CHECK(names.insert(kind.name).second);
    CHECK(kDefault.*kind.member >= kind.in_file.lower);
    CHECK(kDefault.*kind.member <= kind.in_file.upper);
  }
  for (const WorldParameterKind& kind : kWorldParameterKinds) CHECK(names.insert(kind.name).second);
  for (const LinkParameterKind& kind : kLinkParameterKinds)
    CHECK(names.insert(std::string(kind.name) + "/<link>/" + kind.entry).second);
}

TEST_CASE("the first number that is neither known nor as by default is found") {
  JointDynamics dynamics;
  CHECK(FirstNotAmong({}, dynamics) == nullptr);
  dynamics.damping = 1;
  dynamics.no_load_speed = 3;
  CHECK(FirstNotAmong({}, dynamics)->key == std::string("damping"));
  CHECK(FirstNotAmong({&JointDynamics::damping}, dynamics)->key == std::string("no_load_speed"));
  CHECK(FirstNotAmong({&JointDynamics::no_load_speed, &JointDynamics::damping}, dynamics) ==
        nullptr);
}

TEST_CASE("docs/simulation.md tells of every kind of parameter") {
  const std::string text =
      ReadFile(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/docs/simulation.md");
  const auto told = [&](const std::string& words) {
    INFO(words);
    CHECK(text.find(words) != std::string::npos);
  };
  for (const JointParameterKind& kind : kJointParameterKinds) {
    told("\n" + std::string(kind.key) + " = ");
    told("`" + std::string(kind.name) + "/");
  }
  for (const WorldParameterKind& kind : kWorldParameterKinds)
    told("\n" + std::string(kind.key) + " = ");
  for (const LinkParameterKind& kind : kLinkParameterKinds)
    told("`" + std::string(kind.name) + "/<link>");
}

}  // namespace
}  // namespace plumb
