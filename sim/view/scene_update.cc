#include "sim/view/scene_update.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <initializer_list>

#include "common/message_json.h"
#include "robot/kinematics.h"

namespace plumb {
namespace {

constexpr double kGroundEdge = 20;     // [m] edge
constexpr double kThickness = 0.001;   // [m]
constexpr double kTranslucent = 0.35;  // of a prediction
constexpr Color kGroundColor{0.93, 0.92, 0.90};

/// {"x":1,"y":2}
std::string Numbers(std::initializer_list<std::pair<char, double>> members) {
  std::string json = "{";
  for (const auto& [name, value] : members) {
    if (json.size() > 1) json += ',';
    json.append(1, '"').append(1, name).append("\":");
    AppendJsonNumber(value, json);
  }
  return json + "}";
}

/// One entity's solids, by kind.
class Entity {
 public:
  Entity(std::string id, int64_t utime, double alpha)
      : id_(std::move(id)), utime_(utime), alpha_(alpha) {}

  /// @param shape in the frame of a link that has this pose.
  void Add(const Pose& link, const Shape& shape, const Color& color) {
    const Eigen::Matrix3d axes = link.rotation * shape.rotation;
    const Eigen::Vector3d center = link.position + link.rotation * shape.position;
    const double radius = shape.size[0], length = shape.size[1];
    const Eigen::Vector3d ball = Eigen::Vector3d::Constant(2 * radius);
    switch (shape.type) {
      case Shape::Type::kBox:
        return Append(cubes_, center, axes, shape.size, color);
      case Shape::Type::kSphere:
        return Append(spheres_, center, axes, ball, color);
      case Shape::Type::kCapsule:
        Append(spheres_, center + axes.col(2) * length / 2, axes, ball, color);
        Append(spheres_, center - axes.col(2) * length / 2, axes, ball, color);
        [[fallthrough]];
      case Shape::Type::kCylinder:
        return Append(cylinders_, center, axes, {2 * radius, 2 * radius, length}, color,
                      R"("bottom_scale":1,"top_scale":1,)");
    }
  }

  std::string Json() const {
    return fmt::format(
        R"({{"timestamp":{{"sec":{},"nsec":{}}},"frame_id":"world","id":"{}",)"
        R"("lifetime":{{"sec":0,"nsec":0}},"frame_locked":false,"metadata":[],"arrows":[],)"
        R"("cubes":[{}],"spheres":[{}],"cylinders":[{}],)"
        R"("lines":[],"triangles":[],"texts":[],"models":[]}})",
        utime_ / 1'000'000, utime_ % 1'000'000 * 1000, id_, cubes_, spheres_, cylinders_);
  }

 private:
  void Append(std::string& solids, const Eigen::Vector3d& center, const Eigen::Matrix3d& axes,
              const Eigen::Vector3d& size, const Color& color, const char* more = "") const {
    const Eigen::Quaterniond turn(axes);
    if (!solids.empty()) solids += ',';
    solids += fmt::format(
        R"({{"pose":{{"position":{},"orientation":{}}},"size":{},{}"color":{}}})",
        Numbers({{'x', center.x()}, {'y', center.y()}, {'z', center.z()}}),
        Numbers({{'x', turn.x()}, {'y', turn.y()}, {'z', turn.z()}, {'w', turn.w()}}),
        Numbers({{'x', size.x()}, {'y', size.y()}, {'z', size.z()}}), more,
        Numbers({{'r', color.red}, {'g', color.green}, {'b', color.blue}, {'a', alpha_}}));
  }

  const std::string id_;
  const int64_t utime_;
  const double alpha_;
  std::string cubes_, spheres_, cylinders_;
};

}  // namespace

SceneUpdate::SceneUpdate(const RobotDescription& robot) : robot_(robot), shapes_(ShapesOf(robot)) {
  for (size_t link = 0; link < robot.links.size(); ++link)
    colors_.push_back(ColorOf(robot, static_cast<int>(link)));
}

std::string SceneUpdate::Json(int64_t utime, const Eigen::VectorXd& q,
                              const Eigen::VectorXd* prediction) const {
  const auto robot_at = [&](const char* id, const Eigen::VectorXd& at, double alpha) {
    Entity entity(id, utime, alpha);
    const std::vector<Pose> poses = LinkPoses(robot_, at);
    for (size_t link = 0; link < poses.size(); ++link) {
      for (const Shape& shape : shapes_[link]) entity.Add(poses[link], shape, colors_[link]);
    }
    return entity.Json();
  };
  Entity ground("ground", utime, 1);
  Shape plate;
  plate.type = Shape::Type::kBox;
  plate.position.z() = -kThickness / 2;
  plate.size = {kGroundEdge, kGroundEdge, kThickness};
  ground.Add({}, plate, kGroundColor);
  std::string deletions;
  if (!prediction) {
    deletions = fmt::format(R"({{"timestamp":{{"sec":{},"nsec":{}}},"type":0,"id":"prediction"}})",
                            utime / 1'000'000, utime % 1'000'000 * 1000);
  }
  std::string entities = ground.Json() + "," + robot_at("robot", q, 1);
  if (prediction) entities += "," + robot_at("prediction", *prediction, kTranslucent);
  return fmt::format(R"({{"deletions":[{}],"entities":[{}]}})", deletions, entities);
}

std::string SceneUpdate::Schema() {
  const auto object = [](const std::string& properties) {
    return R"({"type":"object","properties":{)" + properties + "}}";
  };
  const auto numbers = [&](const std::string& names) {
    std::string properties;
    for (const char name : names) {
      if (!properties.empty()) properties += ',';
      properties += fmt::format(R"("{}":{{"type":"number"}})", name);
    }
    return object(properties);
  };
  const auto array = [](const std::string& items) {
    return R"({"type":"array","items":)" + items + "}";
  };
  const std::string time = object(R"("sec":{"type":"integer"},"nsec":{"type":"integer"})");
  const std::string solid =
      R"("pose":)" +
      object(R"("position":)" + numbers("xyz") + R"(,"orientation":)" + numbers("xyzw")) +
      R"(,"size":)" + numbers("xyz") + R"(,"color":)" + numbers("rgba");
  const std::string cylinder =
      solid + R"(,"bottom_scale":{"type":"number"},"top_scale":{"type":"number"})";
  const std::string unused = array(object(""));
  const std::string entity = object(
      R"("timestamp":)" + time +
      R"(,"frame_id":{"type":"string"},"id":{"type":"string"},"lifetime":)" + time +
      R"(,"frame_locked":{"type":"boolean"},"metadata":)" + unused + R"(,"arrows":)" + unused +
      R"(,"cubes":)" + array(object(solid)) + R"(,"spheres":)" + array(object(solid)) +
      R"(,"cylinders":)" + array(object(cylinder)) + R"(,"lines":)" + unused + R"(,"triangles":)" +
      unused + R"(,"texts":)" + unused + R"(,"models":)" + unused);
  const std::string deletion =
      object(R"("timestamp":)" + time + R"(,"type":{"type":"integer"},"id":{"type":"string"})");
  return R"({"$schema":"https://json-schema.org/draft/2020-12/schema",)"
         R"("title":"foxglove.SceneUpdate",)"
         R"("type":"object","properties":{"deletions":)" +
         array(deletion) + R"(,"entities":)" + array(entity) + "}}";
}

}  // namespace plumb
