#include "sim/view/picture.h"

#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <stdexcept>

#include "sim/view/gif.h"
#include "sim/view/scene.h"

namespace plumb {
namespace {

constexpr Color kPaper{1, 1, 1}, kInk{0.25, 0.27, 0.30}, kGround{0.93, 0.92, 0.90},
    kLine{0.62, 0.62, 0.62};
/// [m], to the right and up.
struct Box {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity()),
                  high = -low;
  void Add(const Eigen::Vector2d& point) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  Eigen::Vector2d size() const { return high - low; }
};

constexpr double kLowest = 0.1;  // [m] that a picture is high: a robot may have no extent

/// The part of the world that a picture shows, chosen from all that a film shows.
class Framing {
 public:
  Framing(const RobotDescription& robot, const std::vector<Snapshot>& film)
      : robot_(robot), scene_(robot, Across(robot, film)) {
    double widest = 0;
    for (const Snapshot& snapshot : film) {
      const Box box = Moving(snapshot.q);
      all_.Add(box.low);
      all_.Add(box.high);
      widest = std::max(widest, box.size().x());
    }
    // A robot that stays within two of its widths is watched from one place.
    follows_ = all_.size().x() > 2 * widest + 0.5;
    all_.Add({all_.low.x(), 0});  // the ground is in the picture
    if (all_.size().y() < kLowest) all_.Add({all_.low.x(), all_.low.y() + kLowest});
    width_ = (follows_ ? widest : all_.size().x()) + 0.1 * all_.size().y();
    if (robot_.joints.empty()) width_ = 1;
  }

  double width() const { return width_; }
  double bottom() const { return all_.low.y() - 0.06 * all_.size().y(); }
  double top() const { return all_.high.y() + 0.04 * all_.size().y(); }
  double Middle(const Snapshot& snapshot) const {
    const Box box = follows_ ? Moving(snapshot.q) : all_;
    return (box.low.x() + box.high.x()) / 2;
  }
  bool follows() const { return follows_; }
  const Scene& scene() const { return scene_; }
  const RobotDescription& robot() const { return robot_; }

 private:
  /// The horizontal axis along which joints move the links farther; x if in doubt.
  static int Across(const RobotDescription& robot, const std::vector<Snapshot>& film) {
    if (film.empty()) throw std::invalid_argument("there is nothing to draw");
    Eigen::Vector3d travel = Eigen::Vector3d::Zero();
    const std::vector<Pose> first = LinkPoses(robot, film.front().q);
    for (const Snapshot& snapshot : film) {
      const std::vector<Pose> poses = LinkPoses(robot, snapshot.q);
      for (size_t i = 1; i < poses.size(); ++i) {
        const Eigen::Vector3d far = robot.links[i].center_of_mass;
        travel = travel.cwiseMax((poses[i].position - first[i].position).cwiseAbs());
        travel = travel.cwiseMax((poses[i].position + poses[i].rotation * far - first[i].position -
                                  first[i].rotation * far)
                                     .cwiseAbs());
      }
    }
    return travel.y() > travel.x() ? 1 : 0;
  }
  Box Moving(const Eigen::VectorXd& q) const {
    Box box;
    for (const Silhouette& silhouette : scene_.Look(q)) {
      if (silhouette.link == 0) continue;
      for (const Eigen::Vector2d& point : silhouette.outline) box.Add(point);
    }
    if (!(box.size().x() >= 0)) box.Add(Eigen::Vector2d::Zero());
    return box;
  }

  const RobotDescription& robot_;
  Scene scene_;
  Box all_;
  double width_ = 1;
  bool follows_ = false;
};

/// A picture in memory.
class Canvas {
 public:
  Canvas(int width, int height)
      : surface_(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height)),
        cairo_(cairo_create(surface_)) {
    if (cairo_status(cairo_) != CAIRO_STATUS_SUCCESS)
      throw std::runtime_error("cannot make a picture");
    Fill(kPaper);
    cairo_paint(cairo_);
    cairo_select_font_face(cairo_, "sans", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  }
  ~Canvas() {
    cairo_destroy(cairo_);
    cairo_surface_destroy(surface_);
  }
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  void Fill(const Color& c, double opacity = 1) {
    cairo_set_source_rgba(cairo_, c.red, c.green, c.blue, opacity);
  }
  void Text(const std::string& text, double x, double y, double size) {
    cairo_set_font_size(cairo_, size);
    cairo_text_extents_t extents;
    cairo_text_extents(cairo_, text.c_str(), &extents);
    cairo_move_to(cairo_, std::round(x - extents.x_advance / 2), y);
    cairo_show_text(cairo_, text.c_str());
  }
  /// A snapshot in the rectangle at x, 0. @param scale [pixel/m].
  void Draw(const Framing& framing, const Snapshot& snapshot, double x, double width, double height,
            double scale);

  std::string Png() const {
    std::string png;
    const auto append = [](void* to, const unsigned char* data, unsigned int size) {
      static_cast<std::string*>(to)->append(reinterpret_cast<const char*>(data), size);
      return CAIRO_STATUS_SUCCESS;
    };
    if (cairo_surface_write_to_png_stream(surface_, append, &png) != CAIRO_STATUS_SUCCESS) {
      throw std::runtime_error("cannot encode a PNG picture");
    }
    return png;
  }
  /// Pixels of a row, 0x00RRGGBB.
  const uint32_t* Row(int row) const {
    cairo_surface_flush(surface_);
    const ptrdiff_t stride = cairo_image_surface_get_stride(surface_);
    return reinterpret_cast<const uint32_t*>(cairo_image_surface_get_data(surface_) + row * stride);
  }

 private:
  cairo_surface_t* surface_;
  cairo_t* cairo_;
};

void Canvas::Draw(const Framing& framing, const Snapshot& snapshot, double x, double width,
                  double height, double scale) {
  const double middle = framing.Middle(snapshot), bottom = framing.bottom();
  const auto to_x = [&](double across) { return x + width / 2 + (across - middle) * scale; };
  const auto to_y = [&](double up) { return height - (up - bottom) * scale; };
  cairo_save(cairo_);
  cairo_rectangle(cairo_, x, 0, width, height);
  cairo_clip(cairo_);
  Fill(kGround);
  cairo_rectangle(cairo_, x, to_y(0), width, height - to_y(0));
  cairo_fill(cairo_);
  Fill(kLine);
  cairo_set_line_width(cairo_, 1);
  const double ground = std::floor(to_y(0)) + 0.5;
  cairo_move_to(cairo_, x, ground);
  cairo_line_to(cairo_, x + width, ground);
  if (framing.follows()) {  // half metres, to see how far it has got
    for (double mark = std::ceil((middle - width / scale / 2) * 2) / 2; to_x(mark) < x + width;
         mark += 0.5) {
      const bool whole = mark == std::round(mark);
      cairo_move_to(cairo_, std::floor(to_x(mark)) + 0.5, ground);
      cairo_rel_line_to(cairo_, 0, whole ? 7 : 4);
    }
  }
  cairo_stroke(cairo_);

  cairo_set_line_join(cairo_, CAIRO_LINE_JOIN_ROUND);
  for (const Silhouette& silhouette : framing.scene().Look(snapshot.q)) {
    for (const Eigen::Vector2d& point : silhouette.outline)
      cairo_line_to(cairo_, to_x(point.x()), to_y(point.y()));
    cairo_close_path(cairo_);
    const Color color = ColorOf(framing.robot(), silhouette.link);
    Fill(color);
    cairo_fill_preserve(cairo_);
    Fill({color.red * 0.6, color.green * 0.6, color.blue * 0.6});
    cairo_set_line_width(cairo_, 1.2);
    cairo_stroke(cairo_);
  }
  for (const Eigen::Vector2d& hinge : framing.scene().Hinges(snapshot.q)) {
    cairo_arc(cairo_, to_x(hinge.x()), to_y(hinge.y()), 2.2, 0, 7);
    Fill(kPaper);
    cairo_fill_preserve(cairo_);
    Fill(kInk);
    cairo_set_line_width(cairo_, 1);
    cairo_stroke(cairo_);
  }
  cairo_restore(cairo_);
}

constexpr double kTextHeight = 26;  // [pixel], below a picture

}  // namespace

std::string DrawStrip(const RobotDescription& robot, const std::vector<Snapshot>& film,
                      int panels) {
  const Framing framing(robot, film);
  constexpr double kHeight = 220, kNarrowest = 84, kWidest = 180;
  const double scale =
      std::min(kHeight / (framing.top() - framing.bottom()), kWidest / framing.width());
  const double height = std::ceil(scale * (framing.top() - framing.bottom()));
  const double width = std::clamp(std::ceil(scale * framing.width()), kNarrowest, kWidest);
  const int count = std::min(panels, static_cast<int>(film.size()));
  Canvas canvas(static_cast<int>(width) * count, static_cast<int>(height + kTextHeight));
  const int digits = film.back().time - film.front().time < 0.1 * count ? 3 : 2;
  for (int i = 0; i < count; ++i) {
    const size_t at =
        count == 1 ? 0
                   : static_cast<size_t>(i) * (film.size() - 1) / static_cast<size_t>(count - 1);
    canvas.Draw(framing, film[at], i * width, width, height, scale);
    canvas.Fill(kInk);
    canvas.Text(fmt::format("{:.{}f} s", film[at].time, digits), (i + 0.5) * width, height + 18,
                13);
  }
  return canvas.Png();
}

std::string DrawFilm(const RobotDescription& robot, const std::vector<Snapshot>& film) {
  const Framing framing(robot, film);
  constexpr double kHeight = 240, kNarrowest = 320, kWidest = 480;
  constexpr double kFrame = 0.04;  // [s]; browsers slow films down that are faster than 50 Hz
  const double scale =
      std::min(kHeight / (framing.top() - framing.bottom()), kWidest / framing.width());
  const double height = std::ceil(scale * (framing.top() - framing.bottom()));
  const double width = std::clamp(std::ceil(scale * framing.width()), kNarrowest, kWidest);
  // At each frame's time the last snapshot: seldom ones are shown for longer.
  std::vector<const Snapshot*> frames;
  for (size_t last = 0;;) {
    const double time = film.front().time + static_cast<double>(frames.size()) * kFrame + 1e-9;
    while (last + 1 < film.size() && film[last + 1].time <= time) ++last;
    frames.push_back(&film[last]);
    if (last + 1 == film.size()) break;
  }
  const auto columns = static_cast<int>(width), rows = static_cast<int>(height + kTextHeight);
  const auto draw = [&](int frame, std::vector<uint32_t>& pixels) {
    const Snapshot& snapshot = *frames[static_cast<size_t>(frame)];
    Canvas canvas(columns, rows);
    canvas.Draw(framing, snapshot, 0, width, height, scale);
    canvas.Fill(kInk);
    canvas.Text(fmt::format("{:.2f} s", snapshot.time), width / 2, height + 18, 13);
    pixels.clear();
    for (int row = 0; row < rows; ++row)
      pixels.insert(pixels.end(), canvas.Row(row), canvas.Row(row) + columns);
  };
  return EncodeGif(columns, rows, static_cast<int>(frames.size()), static_cast<int>(100 * kFrame),
                   draw);
}

}  // namespace plumb
