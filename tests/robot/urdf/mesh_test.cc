#include "robot/urdf/mesh.h"

#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "common/random.h"
#include "robot/contact_points.h"
#include "robot/description.h"
#include "robot/urdf/urdf.h"
#include "tests/replaced.h"
#include "tests/robot/zoo.h"

namespace plumb {
namespace {

using Catch::Contains;
using Eigen::Vector3d;
namespace fs = std::filesystem;

// A box's eight corners, as twelve triangles, in the three formats.
const Vector3d kHalf(0.1, 0.2, 0.3);

std::vector<Vector3d> BoxTriangles() {
  std::vector<Vector3d> corners;
  const auto corner = [](int i) -> Vector3d {
    return Vector3d(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1).cwiseProduct(kHalf);
  };
  for (const auto& face : {std::array{0, 1, 3, 2},
                           {4, 6, 7, 5},
                           {0, 4, 5, 1},
                           {2, 3, 7, 6},
                           {0, 2, 6, 4},
                           {1, 5, 7, 3}}) {
    for (const int k : {0, 1, 2, 0, 2, 3}) corners.push_back(corner(face[static_cast<size_t>(k)]));
  }
  return corners;
}

std::string BinaryStl(const std::vector<Vector3d>& corners) {
  std::string text(80, ' ');
  std::memcpy(text.data(), "solid", 5);  // as some programs write it, though it is binary
  const auto add = [&](auto number) {
    text.append(reinterpret_cast<const char*>(&number), sizeof number);
  };
  add(static_cast<uint32_t>(corners.size() / 3));
  for (size_t i = 0; i < corners.size(); ++i) {
    if (i % 3 == 0) text.append(12, '\0');
    for (const double entry : corners[i]) add(static_cast<float>(entry));
    if (i % 3 == 2) text.append(2, '\0');
  }
  return text;
}

std::string TextStl(const std::vector<Vector3d>& corners) {
  std::string text = "solid box\r\n";
  for (size_t i = 0; i < corners.size(); ++i) {
    if (i % 3 == 0) text += "facet normal 0 0 0\r\n outer loop\r\n";
    for (const double entry : corners[i])
      text += (entry == corners[i].x() ? "  vertex " : " ") + std::to_string(entry);
    text += i % 3 == 2 ? "\r\n endloop\r\nendfacet\r\n" : "\r\n";
  }
  return text + "endsolid box\r\n";
}

const char kObj[] =
    "# a tetrahedron\nmtllib x.mtl\nv 0 0 0\nv 1 0 0 1.0\nv 0 +1e0 0\nv 0 0 1\nvn 0 0 1\nvt 0 "
    "0\nf 1 2 3\nf 1/1/1 2/2/2 4//3";

TEST_CASE("meshes of all formats are read") {
  for (const std::string& text : {BinaryStl(BoxTriangles()), TextStl(BoxTriangles())}) {
    const std::vector<Vector3d> points = MeshPoints(text);
    REQUIRE(points.size() == 8);
    for (const Vector3d& point : points) CHECK((point.cwiseAbs() - kHalf).norm() < 1e-6);
  }
  CHECK(MeshPoints(kObj).size() == 4);
  CHECK(MeshPoints("v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -3\n").size() == 3);  // 9: no face
}

TEST_CASE("what is no mesh is refused") {
  const auto refused = [](const std::string& text, const std::string& what) {
    CHECK_THROWS_WITH(MeshPoints(text), Contains(what));
  };
  const std::string good = BinaryStl(BoxTriangles());
  refused("", "neither STL nor OBJ");
  refused(good.substr(0, good.size() - 1), "cut short");
  refused(std::string(84, '\0'), "has no face");
  refused("v 1 2 3\nv 1 2\n", "has no three numbers in line 2");
  refused("v 1 2 3x\n", "line 1");
  refused("v 1 2 1e7\n", "beyond 1e6 or not a number");
  for (const char* point : {"nan 0 0", "0 nan 0", "5 5 nan", "0 0 inf"})
    refused(std::string("v ") + point + "\n", "not a number");
  for (const size_t coordinate : {0, 1, 2}) {
    std::string bad = good;
    std::memset(bad.data() + 96 + 4 * coordinate, 0xff, 4);  // NaN
    refused(bad, "not a number");
  }
  refused("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "has no face");
  refused("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "face with an unknown vertex in line 4");
  refused("v 0 0 0\nf 0 1 1\n", "face with an unknown vertex in line 2");
  refused("v 0 0 0\nf x\n", "face with an unknown vertex in line 2");
  const std::string text = TextStl(BoxTriangles());
  refused(text.substr(0, text.find("endsolid")), "cut short");
  refused(text.substr(0, text.rfind("  vertex")) + "endsolid", "cut short");
}

TEST_CASE("whatever its bytes are, a mesh is read or refused") {
  Random random(4);
  int read = 0, refused = 0;
  for (const std::string& good :
       {BinaryStl(BoxTriangles()), TextStl(BoxTriangles()), std::string(kObj)}) {
    for (int i = 0; i < 3000; ++i) {
      std::string text = good;
      const auto at = [&] {
        return static_cast<size_t>(random.Uniform(0, static_cast<double>(text.size())));
      };
      for (int k = 0; k < 1 + i % 8; ++k) text[at()] = static_cast<char>(random.Uniform(-128, 128));
      if (i % 3 == 0) text.resize(at());
      try {
        for (const Vector3d& point : MeshPoints(text)) REQUIRE(point.allFinite());
        FindHullCorners(MeshPoints(text));
        ++read;
      } catch (const std::runtime_error& error) {
        REQUIRE(std::string(error.what()).size() < 100);
        ++refused;
      }
    }
  }
  CHECK(read > 1000);
  CHECK(refused > 3000);
}

TEST_CASE("the corners of a hull reach as far as all points") {
  const HullCorners box = FindHullCorners(MeshPoints(BinaryStl(BoxTriangles())));
  CHECK(box.corners.size() == 8);
  CHECK(box.lost < 1e-9);
  // With points inside and on the faces it is the same.
  Random random(3);
  std::vector<Vector3d> more = BoxTriangles();
  for (int i = 0; i < 1000; ++i) {
    Vector3d point(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 1));
    if (i % 2) point[i % 3] = 1;
    more.push_back(point.cwiseProduct(kHalf));
  }
  const HullCorners full = FindHullCorners(more);
  CHECK(full.lost < 0.0005);
  for (const Vector3d& corner : box.corners) {
    CHECK(std::any_of(full.corners.begin(), full.corners.end(),
                      [&](const Vector3d& other) { return (other - corner).norm() < 1e-6; }));
  }
  // A sphere has too many: what is lost is said. 32 points of a sphere of radius r leave caps of
  // about r (1 - cos(0.36)) at least.
  std::vector<Vector3d> sphere;
  for (int i = 0; i < 5000; ++i)
    sphere.push_back(Vector3d(random.Normal(), random.Normal(), random.Normal()).normalized());
  const HullCorners round = FindHullCorners(sphere);
  CHECK(round.corners.size() == 32);
  CHECK(round.lost > 0.06);
  CHECK(round.lost < 0.2);
  CHECK(FindHullCorners({}).corners.empty());
}

TEST_CASE("meshes are found where ROS has them, and beside the URDF") {
  TemporaryFolder folder;
  const fs::path root = folder.path();
  fs::create_directories(root / "leg" / "urdf");
  fs::create_directories(root / "leg" / "meshes");
  std::ofstream(root / "leg" / "meshes" / "foot.stl") << "x";
  const std::string urdf = root / "leg" / "urdf" / "leg.urdf",
                    mesh = root / "leg" / "meshes" / "foot.stl";
  const auto same = [&](const std::string& found) {
    return !found.empty() && fs::equivalent(found, mesh);
  };
  CHECK(same(FindMesh("package://leg/meshes/foot.stl", urdf)));
  CHECK(same(FindMesh("../meshes/foot.stl", urdf)));
  CHECK(same(FindMesh("file://" + mesh, urdf)));
  CHECK(FindMesh("package://arm/meshes/foot.stl", urdf).empty());
  CHECK(FindMesh("foot.stl", urdf).empty());
  CHECK(FindMesh("package://", urdf).empty());
  CHECK(FindMesh("..", urdf).empty());
}

TEST_CASE("a robot's collision meshes touch the ground, and the file is part of it") {
  const std::string urdf = Replaced(
      kZooUrdf, "<collision><geometry><mesh filename=\"thigh.dae\"/></geometry></collision>",
      "<collision><origin xyz=\"0 0 1\"/>\n<geometry><mesh filename=\"thigh.stl\" scale=\"1 1 "
      "0.5\"/></geometry></collision>");
  const RobotFolder folder(urdf, kZooToml);
  const std::string mesh = folder.path() + "/thigh.stl";
  CHECK_THROWS_WITH(LoadRobot(folder.path()), Contains("robot.urdf:25: link thigh: collision mesh "
                                                       "thigh.stl: there is no such file"));
  std::ofstream(mesh, std::ios::binary) << "nonsense";
  CHECK_THROWS_WITH(
      LoadRobot(folder.path()),
      Contains("robot.urdf:25: link thigh: collision mesh thigh.stl: is neither STL"));
  std::ofstream(mesh, std::ios::binary) << BinaryStl(BoxTriangles());
  const RobotDescription robot = LoadRobot(folder.path());
  int corners = 0;
  for (const ContactPoint& point : ContactPoints(robot)) {
    if (robot.links[static_cast<size_t>(point.link)].name != "thigh" || point.radius > 0) continue;
    ++corners;
    CHECK(std::abs(point.centre.x()) == Approx(0.1));
    CHECK(std::abs(point.centre.z() - 1) == Approx(0.15));
  }
  CHECK(corners == 8);
  std::ofstream(mesh, std::ios::binary) << kObj;  // not an STL by its name, but by what it is
  const RobotDescription other = LoadRobot(folder.path());
  CHECK(other.fingerprint != robot.fingerprint);
  // Without contact nobody asks for it.
  fs::remove(mesh);
  const std::string contact =
      "[simulation.contact]\nstiffness = 20000.0\ndamping = 100.0\nfriction = 0.8\nslip_speed = "
      "0.01\n";
  const std::string friction =
      kZooToml.substr(kZooToml.find("[[parameter]]\nname = \"contact"),
                      kZooToml.find("[[parameter]]\nname = \"com") -
                          kZooToml.find("[[parameter]]\nname = \"contact"));
  folder.Write(urdf, Replaced(Replaced(kZooToml, contact, ""), friction, ""));
  CHECK_NOTHROW(LoadRobot(folder.path()));
}

}  // namespace
}  // namespace plumb
