#include <catch2/catch.hpp>
#include <fstream>

#include "robot/urdf/urdf.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

// Two 1 kg points 2 m apart, the second behind a fixed joint turned by 90 degrees: their common
// centre is in the middle, the inertia about it is that of a dumbbell.
TEST_CASE("links behind fixed joints are merged by the parallel axis theorem") {
  const TemporaryFolder folder;
  const std::string file = folder / "dumbbell.urdf";
  std::ofstream(file) << R"(<robot name="d"><link name="base"/>
    <link name="a"><inertial><origin xyz="0 0 0"/><mass value="1"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
    <link name="b"><inertial><origin xyz="1 0 0" rpy="0 0 0"/><mass value="1"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial></link>
    <joint name="turn" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 2"/>
      <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
    <joint name="weld" type="fixed"><parent link="a"/><child link="b"/>
      <origin xyz="2 -1 0" rpy="0 0 1.5707963267948966"/></joint></robot>)";
  const UrdfModel model = LoadUrdf(file);
  REQUIRE(model.links.size() == 2);
  REQUIRE(model.joints.size() == 1);
  CHECK(model.joints[0].axis == Eigen::Vector3d::UnitZ());
  const LinkDescription& link = model.links[1];
  CHECK(link.mass == 2);
  CHECK((link.center_of_mass - Eigen::Vector3d(1, 0, 0)).norm() < 1e-12);
  // b's own inertia turned: its x axis lies along y now
  const Eigen::Vector3d expected(0.1 + 0.2, 0.1 + 0.1 + 2, 0.1 + 0.2 + 2);
  CHECK((link.inertia.diagonal() - expected).norm() < 1e-12);
}

}  // namespace
}  // namespace plumb
