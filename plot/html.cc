#include "plot/html.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "plot/svg.h"

namespace plumb {

std::string Page(const std::string& title, const std::string& body) {
  return std::string(kPageBegins) +
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>" +
         Escape(title) + "</title>\n<style>" + kPageStyle + "</style></head>\n<body><main>\n" +
         body + "</main></body>\n</html>\n";
}

std::string Verdict(const std::string& css, const std::string& title, const std::string& words) {
  return "<div class=\"verdict " + css + "\"><b>" + Escape(title) + "</b>" + Escape(words) +
         "</div>\n";
}

std::string Number(double value, double sd) {
  if (std::isnan(value)) return "\xe2\x80\x93";  // en dash
  if (std::isinf(value)) return value > 0 ? "\xe2\x88\x9e" : "-\xe2\x88\x9e";
  if (!(sd > 0) || !std::isfinite(sd) || std::abs(value) >= 1e6 || sd < 1e-7)
    return fmt::format("{:.4g}", value);
  const int digits = std::clamp(1 - static_cast<int>(std::floor(std::log10(sd))), 0, 9);
  return fmt::format("{:.{}f}", value, digits);
}

std::string PlusMinus(double value, double sd) {
  return Number(value, sd) + " \xc2\xb1 " + Number(sd, sd);
}

Table::Table(const std::vector<std::string>& header) {
  for (const std::string& cell : header) rows_ += "<th>" + cell + "</th>";
  rows_ = "<tr>" + rows_ + "</tr>\n";
}

void Table::Add(const std::vector<std::string>& cells) {
  rows_ += "<tr>";
  // Numbers stay on a line, words may wrap.
  for (const std::string& cell : cells) {
    rows_ += (cell.size() < 40 ? "<td class=\"n\">" : "<td class=\"words\">") + cell + "</td>";
  }
  rows_ += "</tr>\n";
}

std::string Table::Print() const {
  return "<div class=\"scroll\"><table>\n" + rows_ + "</table></div>\n";
}

std::string Paragraph(const std::string& text) {
  return text.empty() ? "" : "<p>" + Escape(text) + "</p>\n";
}

std::string Figure(const std::string& drawing, const std::string& caption) {
  return "<figure>" + drawing + "<figcaption>" + caption + "</figcaption></figure>\n";
}

std::string Scrolling(const std::string& drawing) {
  return "<div class=\"scroll\">" + drawing + "</div>";
}

}  // namespace plumb
