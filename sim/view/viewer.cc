#include "sim/view/viewer.h"

#include <Simbody.h>

#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "robot/kinematics.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

// The library looks for a visualiser of its own kind: one built for debugging looks for one whose
// name ends in _d, which Debian does not ship. This folder has it under both names.
class VisualizerFolder {
 public:
  VisualizerFolder() {
    const fs::path visualizer = PLUMB_SIMBODY_VISUALIZER;
    std::string name = (fs::temp_directory_path() / "plumb-viewer-XXXXXX").string();
    if (!fs::exists(visualizer)) {
      throw std::runtime_error(visualizer.string() +
                               ": Simbody's visualiser is not there; --png and --gif draw without");
    }
    if (!mkdtemp(name.data())) throw std::runtime_error(name + ": this folder cannot be made");
    path_ = name;
    for (const char* link : {"simbody-visualizer", "simbody-visualizer_d"})
      fs::create_symlink(visualizer, path_ / link);
  }
  ~VisualizerFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  VisualizerFolder(const VisualizerFolder&) = delete;
  VisualizerFolder& operator=(const VisualizerFolder&) = delete;
  SimTK::Array_<SimTK::String> SearchPath() const {
    SimTK::Array_<SimTK::String> path;
    path.push_back(path_.string());
    return path;
  }

 private:
  fs::path path_;
};

SimTK::Transform ToSimbody(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& position) {
  SimTK::Mat33 m;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) m(row, column) = rotation(row, column);
  }
  return {SimTK::Rotation(m), SimTK::Vec3(position[0], position[1], position[2])};
}

/// The robot's shapes where they are now.
class Shapes : public SimTK::DecorationGenerator {
 public:
  explicit Shapes(const RobotDescription& robot) : robot_(robot) {}

  void Set(const Eigen::Ref<const Eigen::VectorXd>& q) { poses_ = LinkPoses(robot_, q); }

  void generateDecorations(const SimTK::State&,
                           SimTK::Array_<SimTK::DecorativeGeometry>& geometry) override {
    const SimTK::Vec3 colors[] = {SimTK::Cyan,    SimTK::Orange, SimTK::Green,
                                  SimTK::Magenta, SimTK::Blue,   SimTK::Red};
    for (size_t link = 0; link < poses_.size(); ++link) {
      const LinkDescription& description = robot_.links[link];
      const auto& shapes =
          description.visuals.empty() ? description.collisions : description.visuals;
      for (const Shape& shape : shapes) {
        const SimTK::Transform pose =
            ToSimbody(poses_[link].rotation * shape.rotation,
                      poses_[link].position + poses_[link].rotation * shape.position);
        const SimTK::Vec3 color =
            link == 0 ? SimTK::Vec3(SimTK::Gray) : colors[(link - 1) % std::size(colors)];
        const auto add = [&](SimTK::DecorativeGeometry solid, const SimTK::Transform& at) {
          geometry.push_back(solid.setTransform(pose * at).setColor(color));
        };
        Add(shape, add);
      }
    }
  }

 private:
  template <class AddSolid>
  static void Add(const Shape& shape, const AddSolid& add) {
    // Simbody's cylinders stand along y.
    const SimTK::Transform upright(SimTK::Rotation(SimTK::Pi / 2, SimTK::XAxis));
    const double radius = shape.size[0], half_length = shape.size[1] / 2;
    switch (shape.type) {
      case Shape::Type::kSphere:
        add(SimTK::DecorativeSphere(radius), SimTK::Transform());
        break;
      case Shape::Type::kCapsule:
        for (const double end : {-half_length, half_length}) {
          add(SimTK::DecorativeSphere(radius), SimTK::Transform(SimTK::Vec3(0, 0, end)));
        }
        add(SimTK::DecorativeCylinder(radius, half_length), upright);
        break;
      case Shape::Type::kCylinder:
        add(SimTK::DecorativeCylinder(radius, half_length), upright);
        break;
      case Shape::Type::kBox:
        add(SimTK::DecorativeBrick(SimTK::Vec3(shape.size[0], shape.size[1], shape.size[2]) / 2),
            SimTK::Transform());
        break;
    }
  }

  RobotDescription robot_;
  std::vector<Pose> poses_;
};

void RequireDisplay() {
  const char* display = std::getenv("DISPLAY");
  if (!display || !*display) {
    throw std::runtime_error(
        "there is no display to open a window on (DISPLAY is not set): --png and --gif draw "
        "without");
  }
}

}  // namespace

class Viewer::Impl {
 public:
  explicit Impl(const RobotDescription& robot)
      : matter_(system_), visualizer_(Prepare(), folder_.SearchPath()), shapes_(new Shapes(robot)) {
    state_ = system_.getDefaultState();
    visualizer_.setSystemUpDirection(SimTK::ZAxis);
    visualizer_.setGroundHeight(0);
    visualizer_.setWindowTitle(robot.name);
    visualizer_.setCameraTransform(
        SimTK::Transform(SimTK::Rotation(SimTK::Pi / 2, SimTK::XAxis), SimTK::Vec3(0, -5, 1.2)));
    visualizer_.setMode(SimTK::Visualizer::RealTime);
    visualizer_.addDecorationGenerator(shapes_);  // which owns them
  }

  void Show(double time, const Eigen::Ref<const Eigen::VectorXd>& q) {
    if (time < last_) offset_ += last_;
    last_ = time;
    state_.setTime(offset_ + time);
    shapes_->Set(q);
    system_.realize(state_, SimTK::Stage::Position);
    visualizer_.report(state_);
  }

 private:
  const SimTK::MultibodySystem& Prepare() {
    system_.realizeTopology();
    return system_;
  }

  VisualizerFolder folder_;
  SimTK::MultibodySystem system_;
  SimTK::SimbodyMatterSubsystem matter_;
  SimTK::Visualizer visualizer_;
  SimTK::State state_;
  Shapes* shapes_;
  double offset_ = 0, last_ = -1;
};

Viewer::Viewer(const RobotDescription& robot) {
  RequireDisplay();
  impl_ = std::make_unique<Impl>(robot);
}

Viewer::~Viewer() = default;

void Viewer::Show(double time, const Eigen::Ref<const Eigen::VectorXd>& q) { impl_->Show(time, q); }

}  // namespace plumb
