#include "robot/contact_pairs.h"

#include <fmt/format.h>

#include <algorithm>

namespace plumb {
namespace {

constexpr size_t kMostPairs = 1000;

using Solids = std::vector<ContactPairs::Solid>;

Solids SolidsOf(const RobotDescription& robot, size_t link) {
  Solids solids;
  const std::vector<Shape>& shapes = robot.links[link].collisions;
  for (size_t i = 0; i < shapes.size(); ++i) {
    if (shapes[i].type != Shape::Type::kCylinder && shapes[i].type != Shape::Type::kMesh)
      solids.push_back({static_cast<int>(link), i});
  }
  return solids;
}

bool Names(const SimulationSettings::LinkPair& pair, const std::string& one,
           const std::string& other) {
  return (Covers(pair.first, one) && Covers(pair.second, other)) ||
         (Covers(pair.first, other) && Covers(pair.second, one));
}

}  // namespace

RoundedBox::RoundedBox(const Shape& shape) {
  switch (shape.type) {
    case Shape::Type::kBox:
      half = shape.size / 2;
      break;
    case Shape::Type::kCapsule:
      half.z() = shape.size.y() / 2;
      [[fallthrough]];
    default:
      radius = shape.size.x();
  }
}

ContactPairs FindContactPairs(const RobotDescription& robot) {
  ContactPairs found;
  const std::vector<SimulationSettings::LinkPair>& named = robot.simulation.link_pairs;
  if (!robot.simulation.contact || named.empty()) return found;
  std::vector<Solids> solids;
  for (size_t link = 0; link < robot.links.size(); ++link) solids.push_back(SolidsOf(robot, link));
  std::vector<bool> used(named.size());
  std::vector<std::pair<ContactPairs::Solid, ContactPairs::Solid>> pairs;
  for (size_t first = 0; first < robot.links.size(); ++first) {
    for (size_t second = first + 1; second < robot.links.size(); ++second) {
      const Solids &ours = solids[first], &theirs = solids[second];
      const bool joined = robot.joints[second - 1].parent == static_cast<int>(first);
      if (ours.empty() || theirs.empty() || (joined && first > 0)) continue;
      bool touch = false;
      for (size_t i = 0; i < named.size(); ++i) {
        if (!Names(named[i], robot.links[first].name, robot.links[second].name)) continue;
        touch = used[i] = true;
      }
      if (!touch) continue;
      if (pairs.size() + ours.size() * theirs.size() > kMostPairs) {
        throw ConfigError(fmt::format("{}more than {} pairs of shapes are to touch each other",
                                      named[0].place, kMostPairs));
      }
      found.solids.insert(found.solids.end(), ours.begin(), ours.end());
      found.solids.insert(found.solids.end(), theirs.begin(), theirs.end());
      for (const ContactPairs::Solid& one : ours) {
        for (const ContactPairs::Solid& other : theirs) pairs.emplace_back(one, other);
      }
    }
  }
  for (size_t i = 0; i < named.size(); ++i) {
    if (used[i]) continue;
    throw ConfigError(fmt::format(
        "{}links = [\"{}\", \"{}\"] are not two links with collision spheres, capsules or boxes "
        "that no joint joins",
        named[i].place, named[i].first, named[i].second));
  }
  std::sort(found.solids.begin(), found.solids.end());
  found.solids.erase(std::unique(found.solids.begin(), found.solids.end()), found.solids.end());
  const auto index = [&](const ContactPairs::Solid& solid) {
    return static_cast<size_t>(std::lower_bound(found.solids.begin(), found.solids.end(), solid) -
                               found.solids.begin());
  };
  for (const auto& [one, other] : pairs) found.pairs.emplace_back(index(one), index(other));
  return found;
}

}  // namespace plumb
