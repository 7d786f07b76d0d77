#include "robot/urdf/mesh.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <string_view>

#include "common/small_letters.h"

namespace plumb {
namespace {

using Eigen::Vector3d;
namespace fs = std::filesystem;

constexpr double kFarthest = 1e6;

void Add(const Vector3d& point, std::vector<Vector3d>* points) {
  if (!(point.array().abs() <= kFarthest).all())
    throw std::runtime_error("has a coordinate that is beyond 1e6 or not a number");
  points->push_back(point);
}

// 80 bytes of anything, the number of triangles, and of each its normal, three corners and two
// bytes of anything: little-endian single precision.
constexpr size_t kHeader = 84, kTriangle = 50, kNormal = 12;

template <class Number>
Number At(const std::string& text, size_t offset) {
  Number number;
  std::memcpy(&number, text.data() + offset, sizeof number);
  return number;
}

bool IsBinaryStl(const std::string& text) {
  return text.size() >= kHeader &&
         text.size() - kHeader == uint64_t{kTriangle} * At<uint32_t>(text, kHeader - 4);
}

std::vector<Vector3d> OfBinaryStl(const std::string& text) {
  std::vector<Vector3d> points;
  for (size_t triangle = kHeader; triangle < text.size(); triangle += kTriangle) {
    for (size_t corner = 0; corner < 3; ++corner) {
      const size_t at = triangle + kNormal + 12 * corner;
      Add({At<float>(text, at), At<float>(text, at + 4), At<float>(text, at + 8)}, &points);
    }
  }
  return points;
}

std::string_view NextWord(std::string_view* line) {
  constexpr std::string_view kSpace = " \t\r";
  line->remove_prefix(std::min(line->find_first_not_of(kSpace), line->size()));
  const std::string_view word = line->substr(0, line->find_first_of(kSpace));
  line->remove_prefix(word.size());
  return word;
}

Vector3d NextPoint(std::string_view* line, int number) {
  Vector3d point;
  for (double& entry : point) {
    std::string_view digits = NextWord(line);
    if (digits.starts_with('+')) digits.remove_prefix(1);
    const char* end = digits.data() + digits.size();
    const auto [last, error] = std::from_chars(digits.data(), end, entry);
    if (error != std::errc() || last != end)
      throw std::runtime_error("has no three numbers in line " + std::to_string(number));
  }
  return point;
}

void ForEachLine(std::string_view text, const std::function<void(std::string_view, int)>& read) {
  for (int number = 1; !text.empty(); ++number) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
    read(line, number);
  }
}

std::vector<Vector3d> OfTextStl(const std::string& text) {
  std::vector<Vector3d> points;
  bool ended = false;
  ForEachLine(text, [&](std::string_view line, int number) {
    const std::string_view word = NextWord(&line);
    ended = ended || word == "endsolid";
    if (word == "vertex") Add(NextPoint(&line, number), &points);
  });
  if (!ended || points.size() % 3 != 0) throw std::runtime_error("is an STL that is cut short");
  return points;
}

// v x y z, and f i/j/k ... of three or more: counted from 1, or backwards from the latest.
std::vector<Vector3d> OfObj(const std::string& text) {
  std::vector<Vector3d> vertices, points;
  ForEachLine(text, [&](std::string_view line, int number) {
    const std::string_view word = NextWord(&line);
    if (word == "v") Add(NextPoint(&line, number), &vertices);
    if (word != "f") return;
    for (std::string_view one = NextWord(&line); !one.empty(); one = NextWord(&line)) {
      const auto count = static_cast<int64_t>(vertices.size());
      int64_t index = 0;
      std::from_chars(one.data(), one.data() + one.size(), index);
      if (index < 0) index += count + 1;
      if (index < 1 || index > count) {
        throw std::runtime_error("has a face with an unknown vertex in line " +
                                 std::to_string(number));
      }
      points.push_back(vertices[static_cast<size_t>(index - 1)]);
    }
  });
  return points;
}

}  // namespace

bool IsMeshFormat(const std::string& file) {
  const std::string ending = InSmallLetters(fs::path(file).extension().string());
  return ending == ".stl" || ending == ".obj";
}

std::vector<Vector3d> MeshPoints(const std::string& text) {
  std::vector<Vector3d> points;
  if (IsBinaryStl(text)) {
    points = OfBinaryStl(text);
  } else if (text.starts_with("solid")) {
    points = OfTextStl(text);
  } else {
    points = OfObj(text);
  }
  if (points.size() < 3)
    throw std::runtime_error("is neither STL nor OBJ, is cut short or has no face");
  const auto before = [](const Vector3d& a, const Vector3d& b) {
    return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
  };
  std::sort(points.begin(), points.end(), before);
  points.erase(std::unique(points.begin(), points.end()), points.end());
  return points;
}

HullCorners FindHullCorners(const std::vector<Vector3d>& points, const Vector3d& scale) {
  constexpr size_t kDirections = 512, kMostCorners = 32;
  constexpr double kEnough = 0.0005;  // [m]
  HullCorners hull;
  if (points.empty()) return hull;
  struct Direction {
    Vector3d along;
    size_t farthest = 0;  // of the points
    double reach = 0, reached = -HUGE_VAL;
    double lost() const { return reach - reached; }
  };
  std::vector<Direction> directions(kDirections);
  for (size_t i = 0; i < kDirections; ++i) {
    const double share = (static_cast<double>(i) + 0.5) / kDirections, z = 1 - 2 * share,
                 turn = 2 * std::numbers::pi * static_cast<double>(i) / std::numbers::phi,
                 across = std::sqrt(1 - z * z);
    Direction& direction = directions[i];
    direction.along = {across * std::cos(turn), across * std::sin(turn), z};
    direction.reach = -HUGE_VAL;
    const Vector3d scaled = direction.along.cwiseProduct(scale);
    for (size_t p = 0; p < points.size(); ++p) {
      const double reach = scaled.dot(points[p]);
      if (reach > direction.reach) direction.reach = reach, direction.farthest = p;
    }
  }
  const auto least_reached = [&] {
    return *std::max_element(
        directions.begin(), directions.end(),
        [](const Direction& a, const Direction& b) { return a.lost() < b.lost(); });
  };
  for (Direction worst = least_reached();
       worst.lost() > kEnough && hull.corners.size() < kMostCorners; worst = least_reached()) {
    const Vector3d corner = points[worst.farthest].cwiseProduct(scale);
    hull.corners.push_back(corner);
    for (Direction& direction : directions)
      direction.reached = std::max(direction.reached, direction.along.dot(corner));
  }
  hull.lost = least_reached().lost();
  return hull;
}

std::string FindMesh(const std::string& named, const std::string& urdf_file) {
  constexpr std::string_view kFile = "file://", kPackage = "package://";
  const fs::path folder = fs::absolute(urdf_file).parent_path();
  std::error_code error;
  const auto there = [&](const fs::path& path) { return fs::is_regular_file(path, error); };
  if (named.starts_with(kFile)) {
    const fs::path path = named.substr(kFile.size());
    return there(path) ? path.string() : "";
  }
  if (!named.starts_with(kPackage)) {
    const fs::path path = folder / named;
    return there(path) ? path.string() : "";
  }
  const fs::path inside = named.substr(kPackage.size());
  const fs::path package = *inside.begin(), rest = inside.lexically_relative(package);
  for (fs::path above = folder;; above = above.parent_path()) {
    if (above.filename() == package && there(above / rest)) return (above / rest).string();
    if (there(above / inside)) return (above / inside).string();
    if (above == above.parent_path()) break;
  }
  const char* listed = std::getenv("ROS_PACKAGE_PATH");
  std::istringstream paths(listed ? listed : "");
  for (std::string path; std::getline(paths, path, ':');) {
    const fs::path root = path;
    if (root.filename() == package && there(root / rest)) return (root / rest).string();
    if (there(root / inside)) return (root / inside).string();
  }
  return "";
}

}  // namespace plumb
