#include "sim/view/picture.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <stdexcept>

#include "sim/view/gif.h"
#include "sim/view/scene.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

std::vector<Snapshot> Swing(int count, double dt) {
  std::vector<Snapshot> film;
  for (int i = 0; i < count; ++i) film.push_back({i * dt, Eigen::VectorXd::Constant(1, 0.1 * i)});
  return film;
}

int BigEndian(const std::string& bytes, size_t at) {
  int value = 0;
  for (size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

}  // namespace

TEST_CASE("a hull has the corners only, counterclockwise") {
  const auto hull = ConvexHull({{0, 0}, {1, 0}, {0.5, 0.2}, {1, 1}, {0, 1}, {0.5, 0}, {0.3, 0.9}});
  REQUIRE(hull.size() == 4);
  CHECK(hull[0] == Eigen::Vector2d(0, 0));
  CHECK(hull[1] == Eigen::Vector2d(1, 0));
  CHECK(hull[2] == Eigen::Vector2d(1, 1));
  CHECK(hull[3] == Eigen::Vector2d(0, 1));
}

TEST_CASE("silhouettes have the shapes' size") {
  RobotDescription robot = LoadPendulum("robot.toml");
  const auto extent = [&](double q, int across) {
    const auto silhouettes = Scene(robot, across).Look(Eigen::VectorXd::Constant(1, q));
    REQUIRE_FALSE(silhouettes.empty());
    Eigen::Vector2d low(1e9, 1e9), high = -low;
    for (const auto& point : silhouettes.back().outline)
      low = low.cwiseMin(point), high = high.cwiseMax(point);
    return Eigen::Vector4d(low.x(), high.x(), low.y(), high.y());
  };
  using Solid = Shape::Type;
  // A rod of 1 m and 2 cm radius on a pivot at 1.2 m.
  CHECK((extent(0, 0) - Eigen::Vector4d(-0.02, 0.02, 1.2, 2.2)).norm() < 1e-9);
  CHECK((extent(M_PI / 2, 0) - Eigen::Vector4d(0, 1, 1.18, 1.22)).norm() < 1e-9);
  // it points at us
  CHECK((extent(M_PI / 2, 1) - Eigen::Vector4d(-0.02, 0.02, 1.18, 1.22)).norm() < 1e-9);
  robot.links[1].visuals[0].type = Solid::kCapsule;
  CHECK((extent(0, 0) - Eigen::Vector4d(-0.02, 0.02, 1.18, 2.22)).norm() < 1e-9);
  robot.links[1].visuals[0] = {
      Solid::kBox, {0, 0, 0.5}, Eigen::Matrix3d::Identity(), {0.2, 0.4, 1}};
  CHECK((extent(0, 0) - Eigen::Vector4d(-0.1, 0.1, 1.2, 2.2)).norm() < 1e-9);
  CHECK((extent(0, 1) - Eigen::Vector4d(-0.2, 0.2, 1.2, 2.2)).norm() < 1e-9);
  robot.links[1].visuals.clear();
  // a stick, to twice the centre
  CHECK((extent(0, 0) - Eigen::Vector4d(-0.02, 0.02, 1.18, 2.22)).norm() < 1e-9);
  robot.links[1].collisions = {
      {Solid::kSphere, {0, 0, 0.5}, Eigen::Matrix3d::Identity(), {0.3, 0, 0}}};
  CHECK((extent(0, 0) - Eigen::Vector4d(-0.3, 0.3, 1.4, 2.0)).norm() < 1e-9);
}

TEST_CASE("a strip is a PNG picture of so many panels, a film a GIF one") {
  const RobotDescription robot = LoadPendulum("robot.toml");
  const std::string eight = DrawStrip(robot, Swing(100, 0.05)),
                    four = DrawStrip(robot, Swing(100, 0.05), 4);
  CHECK(eight.substr(0, 8) == "\x89PNG\r\n\x1a\n");
  CHECK(BigEndian(eight, 16) == 2 * BigEndian(four, 16));
  CHECK(BigEndian(eight, 20) == BigEndian(four, 20));
  CHECK(DrawStrip(robot, Swing(1, 0.05)).substr(1, 3) == "PNG");
  const std::string film = DrawFilm(robot, Swing(50, 0.05));
  CHECK(film.substr(0, 6) == "GIF89a");
  CHECK(film.back() == ';');
  CHECK(film == DrawFilm(robot, Swing(50, 0.05)));
  // in real time, also where states are seldom: 25 pictures per second until 2.45 s
  const std::string frame = "\x21\xF9\x04";  // a graphic control extension
  int frames = 0;
  for (size_t at = film.find(frame); at != film.npos; at = film.find(frame, at + 1)) ++frames;
  CHECK(frames == 63);
  CHECK_THROWS_AS(DrawStrip(robot, {}), std::invalid_argument);
  CHECK_THROWS_AS(DrawFilm(robot, {}), std::invalid_argument);
}

TEST_CASE("robots without shapes and robots that walk away are drawn, too") {
  RobotDescription tree = MakeTree();
  std::vector<Snapshot> film;
  for (int i = 0; i < 30; ++i) film.push_back({0.1 * i, Eigen::Vector4d(0.4 * i, 0.1 * i, 0, 0)});
  CHECK(DrawStrip(tree, film).size() > 1000);
}

TEST_CASE("a film of more colours than GIF has") {
  const std::string film = EncodeGif(40, 30, 3, 4, [](int frame, std::vector<uint32_t>& pixels) {
    pixels.assign(40 * 30, 0);
    for (uint32_t i = 0; i < pixels.size(); ++i)
      pixels[i] = (i * 2654435761u + static_cast<uint32_t>(frame)) & 0xffffff;
  });
  CHECK(film.substr(0, 6) == "GIF89a");
}

}  // namespace plumb
