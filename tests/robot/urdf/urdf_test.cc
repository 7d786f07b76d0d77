#include "robot/urdf/urdf.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>

#include "common/config.h"
#include "common/special_numbers.h"
#include "tests/robot/zoo.h"

namespace plumb {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Type = JointGeometry::Type;

UrdfModel Load(const std::string& urdf) { return LoadUrdf(RobotFolder(urdf, "").urdf()); }

// Base, one body behind a joint of that type.
UrdfModel LoadJoint(const std::string& type, const std::string& inside) {
  return Load("<robot name='r'><link name='base'/><link name='body'/><joint name='j' type='" +
              type + "'><parent link='base'/><child link='body'/>" + inside + "</joint></robot>");
}

TEST_CASE("joints that are held are no joints: what they carry belongs to their parents") {
  const RobotFolder folder(kZooUrdf, "");
  const UrdfModel free = LoadUrdf(folder.urdf()), held = LoadUrdf(folder.urdf(), {"free", "hip"});
  std::vector<std::string> names;
  for (const UrdfJoint& joint : held.joints) names.push_back(joint.name);
  CHECK(names == std::vector<std::string>{"rail/x", "rail/y", "rail/angle", "spring", "disc"});
  double mass = 0, all = 0;
  for (const LinkDescription& link : held.links) mass += link.mass;
  for (const LinkDescription& link : free.links) all += link.mass;
  CHECK(mass == Approx(all));
  CHECK(held.links[0].mass == Approx(free.links[0].mass + free.links[9].mass));  // the ball's
  CHECK(held.links[3].mass == Approx(free.links[3].mass + free.links[4].mass));  // the thigh's
  CHECK_THROWS_WITH(LoadUrdf(folder.urdf(), {"hop"}),
                    "\"hop\" is not a moving joint of the URDF; did you mean hip?");
  CHECK_THROWS_WITH(LoadUrdf(folder.urdf(), {"hip", "hip"}), Catch::Contains("\"hip\" is not"));
}

TEST_CASE("every kind of joint is read, depth first, in the file's order") {
  const UrdfModel zoo = Load(kZooUrdf);
  struct Expected {
    std::string name;
    Type type;
    int parent;
    std::string child;
    Vector3d axis;
  };
  const std::vector<Expected> expected{
      {"rail/x", Type::kPrismatic, 0, "rail/x", Vector3d::UnitX()},
      {"rail/y", Type::kPrismatic, 1, "rail/y", Vector3d::UnitY()},
      {"rail/angle", Type::kContinuous, 2, "carriage", Vector3d::UnitZ()},
      {"hip", Type::kRevolute, 3, "thigh", Vector3d::UnitY()},
      {"spring", Type::kPrismatic, 4, "slider", Vector3d::UnitZ()},
      {"free/x", Type::kPrismatic, 0, "free/x", Vector3d::UnitX()},
      {"free/y", Type::kPrismatic, 6, "free/y", Vector3d::UnitY()},
      {"free/z", Type::kPrismatic, 7, "free/z", Vector3d::UnitZ()},
      {"free/rotation", Type::kSpherical, 8, "ball", Vector3d::UnitX()},
      {"disc", Type::kContinuous, 9, "rotor", Vector3d::UnitX()},
  };
  REQUIRE(zoo.joints.size() == expected.size());
  REQUIRE(zoo.links.size() == expected.size() + 1);
  for (size_t i = 0; i < expected.size(); ++i) {
    const UrdfJoint& joint = zoo.joints[i];
    INFO(joint.name);
    CHECK(joint.name == expected[i].name);
    CHECK(joint.type == expected[i].type);
    CHECK(joint.parent == expected[i].parent);
    CHECK(joint.child == static_cast<int>(i) + 1);
    CHECK(zoo.links[i + 1].name == expected[i].child);
    CHECK((joint.axis - expected[i].axis).norm() < 1e-15);
    const bool part = joint.name.find('/') != std::string::npos;
    CHECK(joint.part == part);
    const bool intermediate = zoo.links[i + 1].name.find('/') != std::string::npos;
    if (intermediate) CHECK(zoo.links[i + 1].mass == 0);
  }
  // The first of the parts is at the origin of the whole, the others where the one before has moved
  // to.
  CHECK(zoo.joints[0].origin == Vector3d(0, 0, 1));
  CHECK(zoo.joints[5].origin == Vector3d(1, 2, 3));
  CHECK((zoo.joints[5].rotation * Vector3d::UnitX() - Vector3d::UnitY()).norm() < 1e-15);
  for (const size_t i : {1, 2, 6, 7, 8}) {
    CHECK(zoo.joints[i].origin.isZero(0));
    CHECK(zoo.joints[i].rotation == Matrix3d::Identity());
  }
  CHECK(zoo.links[3].mass == 2);
  CHECK(zoo.links[9].mass == 0.5);
}

TEST_CASE("limits and dynamics are those of the file, and none are none") {
  const UrdfModel zoo = Load(kZooUrdf);
  for (const size_t i : {0, 1, 2, 5, 6, 7, 8}) {
    INFO(zoo.joints[i].name);
    CHECK(zoo.joints[i].lower == -kInfinity);
    CHECK(zoo.joints[i].upper == kInfinity);
    CHECK(zoo.joints[i].velocity_limit == kInfinity);
    CHECK(zoo.joints[i].effort_limit == 0);
    CHECK(zoo.joints[i].damping == (i < 3 ? 0.5 : 0));
  }
  const UrdfJoint& hip = zoo.joints[3];
  CHECK(hip.lower == -1);
  CHECK(hip.upper == 1.5);
  CHECK(hip.effort_limit == 20);
  CHECK(hip.velocity_limit == 10);
  CHECK(hip.damping == 0.1);
  CHECK(hip.friction == 0.2);
  CHECK(zoo.joints[4].velocity_limit == kInfinity);
  const UrdfModel planar = LoadJoint("planar", "<limit effort='3' velocity='2'/>");
  for (const UrdfJoint& joint : planar.joints) {
    CHECK(joint.effort_limit == 3);
    CHECK(joint.velocity_limit == 2);
  }
}

TEST_CASE("a planar joint's axes are right-handed, and x stays near x") {
  const auto axes = [](const std::string& axis) {
    const UrdfModel model = LoadJoint("planar", "<axis xyz='" + axis + "'/>");
    Matrix3d m;
    for (int i = 0; i < 3; ++i) m.col(i) = model.joints[static_cast<size_t>(i)].axis;
    return m;
  };
  Matrix3d expected;
  CHECK((axes("0 0 1") - Matrix3d::Identity()).norm() < 1e-15);
  expected << 0, 0, 1, 1, 0, 0, 0, 1, 0;  // columns y, z, x
  CHECK((axes("1 0 0") - expected).norm() < 1e-15);
  expected << 1, 0, 0, 0, 0, 1, 0, -1, 0;  // columns x, -z, y
  CHECK((axes("0 1 0") - expected).norm() < 1e-15);
  expected << 1, 0, 0, 0, 0, -1, 0, 1, 0;  // columns x, z, -y
  CHECK((axes("0 -1 0") - expected).norm() < 1e-15);
  for (const char* axis : {"1 2 3", "-1 0.1 0", "0.5 -0.5 -0.1", "1 1e-4 0", "-7 0 0"}) {
    INFO(axis);
    const Matrix3d m = axes(axis);
    CHECK((m.transpose() * m - Matrix3d::Identity()).norm() < 1e-12);
    CHECK(m.determinant() == Approx(1));
  }
  // URDF's default
  CHECK((LoadJoint("planar", "").joints[2].axis - Vector3d::UnitX()).norm() < 1e-15);
}

// A link welded on at (1, 0, 0) and turned by 90 degrees about z; on it another at (0, 2, 0),
// turned by 90 degrees about x. Where things are, by hand: R1 = [-y for y -> ...]: R1 (x, y, z) =
// (-y, x, z), R2 (x, y, z) = (x, -z, y). The second frame's origin is (1, 0, 0) + R1 (0, 2, 0) =
// (-1, 0, 0), its axes R1 R2 (x, y, z) = (z, x, y).
TEST_CASE("solids, masses and joints are carried through rotated welds") {
  const UrdfModel model =
      Load(R"(<robot name="r"><link name="base"/><link name="a"/><link name="b"/>
    <link name="c"><inertial><origin xyz="1 2 3"/><mass value="4"/>
        <inertia ixx="0.5" ixy="0.01" ixz="0.02" iyy="0.6" iyz="0.03" izz="0.7"/></inertial>
      <visual><origin xyz="1 2 3" rpy="0 0 0"/><geometry><box size="1 2 3"/></geometry></visual>
      <collision><origin xyz="0 0 5"/>
        <geometry><capsule radius="0.1" length="0.4"/></geometry></collision>
      <collision><geometry><mesh filename="m"/></geometry></collision>
      <collision><origin xyz="0 1 0"/>
        <geometry><cylinder radius="0.2" length="0.3"/></geometry></collision>
      <collision><origin xyz="0 1 0"/><geometry><sphere radius="0.7"/></geometry></collision>
    </link><link name="d"/>
    <joint name="turn" type="continuous"><parent link="base"/><child link="a"/></joint>
    <joint name="w1" type="fixed"><parent link="a"/><child link="b"/>
      <origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/></joint>
    <joint name="w2" type="fixed"><parent link="b"/><child link="c"/>
      <origin xyz="0 2 0" rpy="1.5707963267948966 0 0"/></joint>
    <joint name="last" type="prismatic"><parent link="c"/><child link="d"/><origin xyz="0 0 1"/>
      <axis xyz="1 0 0"/>
      <limit lower="0" upper="1"/></joint></robot>)");
  Matrix3d axes;
  axes << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  REQUIRE(model.links.size() == 3);
  const LinkDescription& link = model.links[1];
  CHECK(link.mass == 4);
  CHECK((link.center_of_mass - Vector3d(-1 + 3, 1, 2)).norm() < 1e-14);
  Matrix3d inertia;  // x' = z, y' = x, z' = y
  inertia << 0.7, 0.02, 0.03, 0.02, 0.5, 0.01, 0.03, 0.01, 0.6;
  CHECK((link.inertia - inertia).norm() < 1e-14);
  REQUIRE(link.visuals.size() == 1);
  CHECK(link.visuals[0].type == Shape::Type::kBox);
  CHECK(link.visuals[0].size == Vector3d(1, 2, 3));
  CHECK((link.visuals[0].position - Vector3d(2, 1, 2)).norm() < 1e-14);
  CHECK((link.visuals[0].rotation - axes).norm() < 1e-14);
  REQUIRE(link.collisions.size() == 3);
  CHECK(link.collisions[0].type == Shape::Type::kCapsule);
  CHECK(link.collisions[0].size == Vector3d(0.1, 0.4, 0));
  CHECK((link.collisions[0].position - Vector3d(4, 0, 0)).norm() < 1e-14);
  CHECK((link.collisions[0].rotation.col(2) - Vector3d::UnitX()).norm() < 1e-14);
  CHECK(link.collisions[1].type == Shape::Type::kCylinder);
  CHECK(link.collisions[1].size == Vector3d(0.2, 0.3, 0));
  CHECK(link.collisions[2].type == Shape::Type::kSphere);
  CHECK(link.collisions[2].size.x() == 0.7);
  CHECK((link.collisions[2].position - Vector3d(-1, 0, 1)).norm() < 1e-14);
  CHECK((model.joints[1].origin - Vector3d(0, 0, 0)).norm() < 1e-14);
  CHECK((model.joints[1].rotation - axes).norm() < 1e-14);
  REQUIRE(model.contact_warnings.size() == 1);
  CHECK_THAT(model.contact_warnings[0],
             Catch::Contains("robot.urdf:9: link c: a collision cylinder"));
  REQUIRE(model.collision_meshes.size() == 1);
  CHECK(model.collision_meshes[0].link == 1);
  CHECK(model.collision_meshes[0].mesh.file == "m");
  CHECK((model.collision_meshes[0].mesh.origin.at - Vector3d(-1, 0, 0)).norm() < 1e-14);
}

TEST_CASE("what nothing reads is said") {
  const UrdfModel model = LoadJoint("floating", "<colour/>\n<gazebo/><safety_controller/>");
  REQUIRE(model.warnings.size() == 1);
  CHECK_THAT(model.warnings[0], Catch::Contains("robot.urdf:1: <colour> in <joint> is not known"));
}

TEST_CASE("joints in the order of the file, not of the alphabet") {
  const UrdfModel model =
      Load(R"(<robot name="r"><link name="base"/><link name="a"/><link name="b"/>
    <joint name="z" type="continuous"><parent link="base"/><child link="b"/></joint>
    <joint name="y" type="continuous"><parent link="base"/><child link="a"/></joint></robot>)");
  CHECK(model.joints[0].name == "z");
  CHECK(model.joints[1].name == "y");
}

}  // namespace
}  // namespace plumb
