#include "robot/contact_points.h"

namespace plumb {

std::vector<std::pair<Eigen::Vector3d, double>> ContactSpheres(const Shape& shape) {
  const Eigen::Vector3d half = shape.rotation * Eigen::Vector3d(0, 0, shape.size(1) / 2);
  switch (shape.type) {
    case Shape::Type::kSphere:
      return {{shape.position, shape.size(0)}};
    case Shape::Type::kCapsule:
      return {{shape.position - half, shape.size(0)}, {shape.position + half, shape.size(0)}};
    case Shape::Type::kBox: {
      std::vector<std::pair<Eigen::Vector3d, double>> corners;
      for (int corner = 0; corner < 8; ++corner) {
        const Eigen::Vector3d signs(corner & 1 ? .5 : -.5, corner & 2 ? .5 : -.5,
                                    corner & 4 ? .5 : -.5);
        corners.emplace_back(shape.position + shape.rotation * signs.cwiseProduct(shape.size), 0);
      }
      return corners;
    }
    case Shape::Type::kMesh: {
      std::vector<std::pair<Eigen::Vector3d, double>> corners;
      for (const Eigen::Vector3d& corner : shape.corners)
        corners.emplace_back(shape.position + shape.rotation * corner, 0);
      return corners;
    }
    case Shape::Type::kCylinder:
      break;
  }
  return {};
}

std::vector<ContactPoint> ContactPoints(const RobotDescription& robot) {
  std::vector<ContactPoint> points;
  if (!robot.simulation.contact) return points;
  for (size_t link = 1; link < robot.links.size(); ++link) {
    for (const Shape& shape : robot.links[link].collisions) {
      for (const auto& [centre, radius] : ContactSpheres(shape))
        points.push_back({static_cast<int>(link), centre, radius});
    }
  }
  return points;
}

}  // namespace plumb
