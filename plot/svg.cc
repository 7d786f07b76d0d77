#include "plot/svg.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/decompositions.h"
#include "common/outside_text.h"

namespace plumb {
namespace {

// 1e-04 -> 1e-4, 1e+05 -> 1e5.
std::string General(double value) {
  std::string text = fmt::format("{:.4g}", value);
  const size_t e = text.find('e');
  if (e == std::string::npos) return text;
  const bool negative = text[e + 1] == '-';
  const size_t digits = text.find_first_not_of("+-0", e + 1);
  return text.substr(0, e + 1) + (negative ? "-" : "") + text.substr(digits);
}

std::string Label(double value, double step) {
  if (std::abs(value) < 1e-9 * step) return "0";
  const double largest = std::abs(value);
  if (largest >= 1e5 || largest < 1e-4) return General(value);
  const int digits = std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9)));
  return fmt::format("{:.{}f}", value, digits);
}

constexpr char kStyle[] =
    R"(text { font: 12px system-ui, "Segoe UI", Helvetica, Arial, sans-serif; fill: #1b2330; }
text.tick { font-size: 11px; fill: #5b6676; } text.name { font-weight: 600; }
.paper { fill: #ffffff; } .frame { fill: none; stroke: #d8dee6; }
.grid { fill: none; stroke: #e8ecf1; }
)";

}  // namespace

std::string Escape(const std::string& text) {
  std::string escaped;
  for (const char c : Printable(text, Lines::kMany)) {
    if (c == '&') {
      escaped += "&amp;";
    } else if (c == '<') {
      escaped += "&lt;";
    } else if (c == '>') {
      escaped += "&gt;";
    } else if (c == '"') {
      escaped += "&quot;";
    } else if (c == '\'') {
      escaped += "&#39;";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

std::string Shorten(const std::string& text, size_t length) {
  if (text.size() <= length) return text;
  const size_t tail = 2 * (length - 1) / 3;
  return text.substr(0, length - 1 - tail) + "\xe2\x80\xa6" + text.substr(text.size() - tail);
}

Axis::Axis(double lower, double upper, double from, double to, bool logarithmic)
    : lower_(lower), upper_(upper), from_(from), to_(to), logarithmic_(logarithmic) {
  if (!std::isfinite(lower_) || (logarithmic_ && lower_ <= 0)) lower_ = logarithmic_ ? 0.1 : 0;
  if (!std::isfinite(upper_) || upper_ < lower_) upper_ = lower_;
  if (upper_ - lower_ > 1e-12 * std::abs(upper_)) return;
  if (logarithmic_) {
    lower_ /= 2, upper_ *= 2;
  } else {
    const double room =
        std::max(1e-9 * std::abs(lower_), lower_ == 0 ? 1. : 1e-3 * std::abs(lower_));
    lower_ -= room, upper_ += room;
  }
}

double Axis::Pixel(double value) const {
  const double share = logarithmic_ ? std::log(value / lower_) / std::log(upper_ / lower_)
                                    : (value - lower_) / (upper_ - lower_);
  return from_ + share * (to_ - from_);
}

std::vector<Axis::Tick> Axis::Ticks(int count) const {
  std::vector<Tick> ticks;
  if (!logarithmic_) {
    // The smallest of 1, 2, 5 times a power of ten that gives few enough.
    double step = std::pow(10, std::floor(std::log10((upper_ - lower_) / count)));
    for (const double factor : {2., 2.5, 2.}) {
      if ((upper_ - lower_) / step <= count) break;
      step *= factor;
    }
    for (double k = std::ceil(lower_ / step - 1e-9); k * step <= upper_ + 1e-9 * step; ++k) {
      ticks.push_back({k * step, Label(k * step, step)});
    }
    return ticks;
  }
  const double decades = std::log10(upper_ / lower_);
  const int every = std::max(1, static_cast<int>(std::ceil(decades / count)));
  const int first = static_cast<int>(std::floor(std::log10(lower_))),
            last = static_cast<int>(std::ceil(std::log10(upper_)));
  for (int exponent = first; exponent <= last; ++exponent) {
    const auto add = [&](double factor) {
      const double value = factor * std::pow(10, exponent);
      if (value >= lower_ * (1 - 1e-9) && value <= upper_ * (1 + 1e-9))
        ticks.push_back({value, General(value)});
    };
    if (exponent % every == 0) add(1);
    if (decades < 2) add(2), add(5);
  }
  return ticks;
}

Svg::Svg(double width, double height, const std::string& title)
    : width_(width), height_(height), title_(Escape(title)) {}

void Svg::Line(double x1, double y1, double x2, double y2, const std::string& css) {
  Path({{x1, y1}, {x2, y2}}, css);
}

void Svg::Path(const std::vector<Eigen::Vector2d>& points, const std::string& css, bool closed) {
  std::string d;
  char command = 'M';
  for (const Eigen::Vector2d& p : points) {
    if (!p.allFinite()) {
      command = 'M';
      continue;
    }
    d += fmt::format("{}{:.1f} {:.1f}", command, p.x(), p.y());
    command = 'L';
  }
  if (!d.empty())
    body_ += fmt::format("<path class=\"{}\" d=\"{}{}\"/>\n", css, d, closed ? "Z" : "");
}

void Svg::Circle(double x, double y, double radius, const std::string& css) {
  if (!std::isfinite(x) || !std::isfinite(y)) return;
  body_ += fmt::format("<circle class=\"{}\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\"/>\n", css, x, y,
                       radius);
}

void Svg::Dots(const std::vector<Eigen::Vector2d>& points, const std::string& css) {
  std::string d;
  for (const Eigen::Vector2d& p : points) {
    if (p.allFinite()) d += fmt::format("M{:.1f} {:.1f}h0", p.x(), p.y());
  }
  if (!d.empty()) body_ += fmt::format("<path class=\"{}\" d=\"{}\"/>\n", css, d);
}

void Svg::Rectangle(double x, double y, double width, double height, const std::string& css) {
  if (!std::isfinite(x + y + width + height)) return;
  body_ += fmt::format(
      "<rect class=\"{}\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"/>\n", css, x,
      y, std::max(0., width), std::max(0., height));
}

void Svg::Text(double x, double y, const std::string& text, const std::string& css, Anchor anchor,
               double angle) {
  if (!std::isfinite(x) || !std::isfinite(y)) return;
  constexpr const char* kAnchors[] = {"start", "middle", "end"};
  const std::string turn =
      angle == 0 ? "" : fmt::format(" transform=\"rotate({} {:.1f} {:.1f})\"", angle, x, y);
  body_ +=
      fmt::format("<text class=\"{}\" x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"{}>{}</text>\n",
                  css, x, y, kAnchors[static_cast<int>(anchor)], turn, Escape(text));
}

// A nested <svg> clips without an id that would have to be unique in the page.
void Svg::BeginClip(double x, double y, double width, double height) {
  body_ += fmt::format(
      "<svg x=\"{0:.1f}\" y=\"{1:.1f}\" width=\"{2:.1f}\" height=\"{3:.1f}\" viewBox=\"{0:.1f} "
      "{1:.1f} "
      "{2:.1f} {3:.1f}\">\n",
      x, y, width, height);
}

void Svg::Frame(const Axis& x, const Axis& y, const std::string& x_label,
                const std::string& y_label, int x_ticks, int y_ticks) {
  const double left = x.from(), right = x.to(), bottom = y.from(), top = y.to();
  if (!x_label.empty()) {
    for (const auto& [value, label] : x.Ticks(x_ticks)) {
      Line(x.Pixel(value), bottom, x.Pixel(value), top, "grid");
      Text(x.Pixel(value), bottom + 16, label, "tick");
    }
    Text((left + right) / 2, bottom + 34, x_label);
  }
  if (!y_label.empty()) {
    for (const auto& [value, label] : y.Ticks(y_ticks)) {
      Line(left, y.Pixel(value), right, y.Pixel(value), "grid");
      Text(left - 6, y.Pixel(value) + 4, label, "tick", Anchor::kEnd);
    }
    Text(left - 52, (top + bottom) / 2, y_label, "label", Anchor::kMiddle, -90);
  }
  Rectangle(left, top, right - left, bottom - top, "frame");
}

std::string Svg::Print() const {
  return fmt::format(
      "<svg class=\"plot\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" "
      "width=\"{0:.0f}\" "
      "height=\"{1:.0f}\" role=\"img\"><title>{2}</title>\n{3}</svg>\n",
      width_, height_, title_, body_);
}

std::string Svg::PrintAlone(const std::string& rules) const {
  Svg alone = *this;
  alone.body_ = fmt::format("<style>\n{}{}</style>\n{}", kStyle, rules, body_);
  return alone.Print();
}

std::vector<Eigen::Vector2d> Ellipse(const Eigen::Vector2d& mean, const Eigen::Matrix2d& covariance,
                                     double sigma) {
  std::vector<Eigen::Vector2d> points;
  if (!mean.allFinite() || !covariance.allFinite()) return points;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(Eigen::MatrixXd{covariance});
  const Eigen::Matrix2d root =
      eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  constexpr int kPoints = 64;
  for (int i = 0; i < kPoints; ++i) {
    const double angle = 2 * M_PI * i / kPoints;
    points.push_back(mean + sigma * root * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  return points;
}

}  // namespace plumb
