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

// Parts of JSON Schemas.
std::string Object(const std::string& properties) {
  return R"({"type":"object","properties":{)" + properties + "}}";
}
std::string NumbersSchema(const std::string& names) {
  std::string properties;
  for (const char name : names) {
    if (!properties.empty()) properties += ',';
    properties += fmt::format(R"("{}":{{"type":"number"}})", name);
  }
  return Object(properties);
}
std::string Time() { return Object(R"("sec":{"type":"integer"},"nsec":{"type":"integer"})"); }
std::string Titled(const std::string& title, const std::string& properties) {
  return R"({"$schema":"https://json-schema.org/draft/2020-12/schema","title":")" + title +
         R"(","type":"object","properties":{)" + properties + "}}";
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
      case Shape::Type::kMesh:  // is a box here
        return;
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

// A ground that ends is not one: it goes with the robot.
Eigen::Vector3d SceneUpdate::Place(const std::vector<Pose>& poses) const {
  for (size_t link = 0; link < poses.size(); ++link) {
    const Eigen::Vector3d& at = poses[link].position;
    if (!shapes_[link].empty()) return {at.x(), at.y(), 0};
  }
  return Eigen::Vector3d::Zero();
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
  plate.position = Place(LinkPoses(robot_, q)) - Eigen::Vector3d(0, 0, kThickness / 2);
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

std::string SceneUpdate::FrameJson(int64_t utime, const Eigen::VectorXd& q) const {
  const Eigen::Vector3d at = Place(LinkPoses(robot_, q));
  return fmt::format(
      R"({{"timestamp":{{"sec":{},"nsec":{}}},"parent_frame_id":"world","child_frame_id":"robot",)"
      R"("translation":{},"rotation":{}}})",
      utime / 1'000'000, utime % 1'000'000 * 1000,
      Numbers({{'x', at.x()}, {'y', at.y()}, {'z', at.z()}}),
      Numbers({{'x', 0}, {'y', 0}, {'z', 0}, {'w', 1}}));
}

std::string SceneUpdate::FrameSchema() {
  return Titled("foxglove.FrameTransform",
                R"("timestamp":)" + Time() +
                    R"(,"parent_frame_id":{"type":"string"},"child_frame_id":{"type":"string"},)"
                    R"("translation":)" +
                    NumbersSchema("xyz") + R"(,"rotation":)" + NumbersSchema("xyzw"));
}

std::string SceneUpdate::Schema() {
  const auto array = [](const std::string& items) {
    return R"({"type":"array","items":)" + items + "}";
  };
  const std::string time = Time();
  const std::string solid = R"("pose":)" +
                            Object(R"("position":)" + NumbersSchema("xyz") + R"(,"orientation":)" +
                                   NumbersSchema("xyzw")) +
                            R"(,"size":)" + NumbersSchema("xyz") + R"(,"color":)" +
                            NumbersSchema("rgba");
  const std::string cylinder =
      solid + R"(,"bottom_scale":{"type":"number"},"top_scale":{"type":"number"})";
  const std::string unused = array(Object(""));
  const std::string entity = Object(
      R"("timestamp":)" + time +
      R"(,"frame_id":{"type":"string"},"id":{"type":"string"},"lifetime":)" + time +
      R"(,"frame_locked":{"type":"boolean"},"metadata":)" + unused + R"(,"arrows":)" + unused +
      R"(,"cubes":)" + array(Object(solid)) + R"(,"spheres":)" + array(Object(solid)) +
      R"(,"cylinders":)" + array(Object(cylinder)) + R"(,"lines":)" + unused + R"(,"triangles":)" +
      unused + R"(,"texts":)" + unused + R"(,"models":)" + unused);
  const std::string deletion =
      Object(R"("timestamp":)" + time + R"(,"type":{"type":"integer"},"id":{"type":"string"})");
  return Titled("foxglove.SceneUpdate",
                R"("deletions":)" + array(deletion) + R"(,"entities":)" + array(entity));
}

}  // namespace plumb
