#include "records/drake_viewer.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cstdlib>

#include "robot/kinematics.h"
#include "sim/view/scene.h"

namespace plumb {
namespace {

RobotDescription Robot(const std::string& name) {
  return LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/" + name);
}

TEST_CASE("Drake's messages have Drake's fingerprints") {
  CHECK(drake::lcmt_viewer_load_robot::getHash() == static_cast<int64_t>(0x8987209b10aa2d39));
  CHECK(drake::lcmt_viewer_draw::getHash() == 0x414f0bfe5b2f4244);
}

TEST_CASE("every shape of every robot is where the robot's links are") {
  const RobotDescription robot =
      Robot(GENERATE("pendulum", "hopper", "cartpole", "double_pendulum"));
  INFO(robot.name);
  DrakeViewer viewer(robot);
  const auto shapes = ShapesOf(robot);
  REQUIRE(viewer.load().num_links == static_cast<int>(robot.links.size()));
  Eigen::VectorXd q = Eigen::VectorXd::LinSpaced(robot.num_positions(), 0.1, 0.9);
  const drake::lcmt_viewer_draw& draw = viewer.Draw(1'234'567, q);
  CHECK(draw.timestamp == 1234);
  REQUIRE(draw.num_links == viewer.load().num_links);
  const std::vector<Pose> poses = LinkPoses(robot, q);
  size_t drawn = 0;
  for (size_t i = 0; i < robot.links.size(); ++i) {
    const drake::lcmt_viewer_link_data& link = viewer.load().link[i];
    INFO(link.name);
    CHECK(link.name == robot.name + "::" + robot.links[i].name);
    CHECK(draw.link_name[i] == link.name);
    CHECK(draw.robot_num[i] == link.robot_num);
    CHECK(Eigen::Map<const Eigen::Vector3f>(draw.position[i].data())
              .isApprox(poses[i].position.cast<float>()));
    const auto& w = draw.quaternion[i];
    CHECK(Eigen::Quaternionf(w[0], w[1], w[2], w[3])
              .toRotationMatrix()
              .isApprox(poses[i].rotation.cast<float>(), 1e-5f));
    REQUIRE(link.geom.size() == shapes[i].size());
    for (size_t j = 0; j < shapes[i].size(); ++j) {
      const drake::lcmt_viewer_geometry_data& geometry = link.geom[j];
      const Shape& shape = shapes[i][j];
      // The numbers that meldis unpacks of each kind.
      const std::map<int, size_t> numbers{{1, 3}, {2, 1}, {3, 2}, {5, 2}};
      REQUIRE(numbers.contains(geometry.type));
      REQUIRE(geometry.float_data.size() == numbers.at(geometry.type));
      for (size_t k = 0; k < geometry.float_data.size(); ++k)
        CHECK(geometry.float_data[k] == Approx(shape.size[static_cast<Eigen::Index>(k)]));
      CHECK(geometry.position[2] == Approx(shape.position.z()));
      CHECK(geometry.color[3] == 1);
      ++drawn;
    }
  }
  CHECK(drawn > 0);
  CHECK_THROWS_AS(viewer.Draw(0, Eigen::VectorXd(robot.num_positions() + 1)),
                  std::invalid_argument);
}

TEST_CASE("Drake's messages come through LCM as they are") {
  DrakeViewer viewer(Robot("hopper"));
  const auto again = [](const auto& message) {
    std::vector<uint8_t> bytes(static_cast<size_t>(message.getEncodedSize()));
    const int size = static_cast<int>(bytes.size());
    REQUIRE(message.encode(bytes.data(), 0, size) == size);
    std::decay_t<decltype(message)> decoded;
    REQUIRE(decoded.decode(bytes.data(), 0, size) == size);
    return decoded;
  };
  CHECK(again(viewer.load()).link.back().name == viewer.load().link.back().name);
  const auto draw = again(viewer.Draw(0, Eigen::VectorXd::Zero(Robot("hopper").num_positions())));
  CHECK(draw.position.size() == viewer.load().link.size());
}

}  // namespace
}  // namespace plumb
