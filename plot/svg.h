#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace plumb {

// Functions here are pure: thread-safe. An Axis is immutable, hence thread-safe; an Svg is not.

/// For text and attribute values of HTML and SVG: & < > " ' are escaped, control characters and
/// bytes that are not UTF-8 replaced, so that a page stays well-formed XML whatever a file called
/// itself.
std::string Escape(const std::string& text);

/// At most `length` bytes and an ellipsis in their middle: of a path the end tells most. For ASCII.
std::string Shorten(const std::string& text, size_t length);

/// An axis of a plot: values to pixels, linear or logarithmic.
class Axis {
 public:
  /// @param lower,upper finite; widened where they do not differ. Logarithmic: > 0.
  /// @param from,to pixels of lower and upper.
  Axis(double lower, double upper, double from, double to, bool logarithmic = false);

  double Pixel(double value) const;
  double lower() const { return lower_; }
  double upper() const { return upper_; }
  double from() const { return from_; }
  double to() const { return to_; }
  bool Contains(double value) const { return value >= lower_ && value <= upper_; }

  struct Tick {
    double value;
    std::string label;
  };
  /// At most `count` round values; logarithmic: powers of ten, with 2 and 5 between where there are
  /// few.
  std::vector<Tick> Ticks(int count) const;

 private:
  double lower_, upper_, from_, to_;
  bool logarithmic_;
};

/// A drawing under construction. Everything has a CSS class, which gives it its colours: dark and
/// light in one drawing. Coordinates are pixels, y downwards; what is not finite is left out.
class Svg {
 public:
  /// @param title is read out to those who cannot see the drawing.
  Svg(double width, double height, const std::string& title);

  void Line(double x1, double y1, double x2, double y2, const std::string& css);
  /// Points (x, y) in rows; interrupted where one is not finite.
  void Path(const std::vector<Eigen::Vector2d>& points, const std::string& css,
            bool closed = false);
  /// Many dots, as large as the class' stroke is wide, with round caps.
  void Dots(const std::vector<Eigen::Vector2d>& points, const std::string& css);
  void Circle(double x, double y, double radius, const std::string& css);
  void Rectangle(double x, double y, double width, double height, const std::string& css);
  enum class Anchor { kStart, kMiddle, kEnd };
  /// @param angle [deg] clockwise, about (x, y).
  void Text(double x, double y, const std::string& text, const std::string& css = "label",
            Anchor anchor = Anchor::kMiddle, double angle = 0);
  /// Clips all that follows to that rectangle, until EndClip.
  void BeginClip(double x, double y, double width, double height);
  void EndClip() { body_ += "</svg>\n"; }

  /// A frame with ticks below and to the left; grid lines across. Empty labels leave the ticks out.
  void Frame(const Axis& x, const Axis& y, const std::string& x_label, const std::string& y_label,
             int x_ticks = 5, int y_ticks = 5);

  /// For a page, whose style it takes.
  std::string Print() const;
  /// For a file of its own, which brings its style: of text, paper, frame and grid, and by `rules`.
  std::string PrintAlone(const std::string& rules) const;

 private:
  double width_, height_;
  std::string title_, body_;
};

/// The ellipse of points with Mahalanobis distance `sigma` from the mean, closed, 64 of them.
/// @param covariance 2 x 2, positive semidefinite. @return empty if it is not finite.
std::vector<Eigen::Vector2d> Ellipse(const Eigen::Vector2d& mean, const Eigen::Matrix2d& covariance,
                                     double sigma);

}  // namespace plumb
