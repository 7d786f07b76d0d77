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

std::string Group(const std::string& title, const std::string& panels) {
  return "<section class=\"group\"><h2>" + Escape(title) + "</h2>\n<div class=\"panels\">\n" +
         panels + "</div></section>\n";
}

std::string Panel(Width width, const std::string& title, const std::string& what,
                  const std::string& content) {
  return fmt::format("<section class=\"panel {}\"><header><h3>{}</h3></header>\n",
                     width == Width::kHalf ? "half" : "full", Escape(title)) +
         "<p class=\"what\">" + Escape(what) + "</p>\n" + content + "</section>\n";
}

std::string Key(const std::vector<std::pair<std::string, std::string>>& items) {
  std::string html;
  for (const auto& [kind, label] : items)
    html += "<li><i class=\"" + kind + "\"></i>" + Escape(label) + "</li>";
  return "<ul class=\"key\">" + html + "</ul>\n";
}

std::string PriorPosteriorKey() {
  return Key({{"prior dash", "prior"}, {"posterior", "posterior"}});
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
  for (const std::string& cell : header) header_ += "<th scope=\"col\">" + cell + "</th>";
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
  return "<div class=\"scroll\"><table>\n<thead><tr>" + header_ + "</tr></thead>\n<tbody>\n" +
         rows_ + "</tbody></table></div>\n";
}

std::string Paragraph(const std::string& text) {
  return text.empty() ? "" : "<p>" + Escape(text) + "</p>\n";
}

std::string Row(const std::string& drawings) {
  return "<div class=\"row\">" + drawings + "</div>\n";
}

std::string Scrolling(const std::string& drawing) {
  return "<div class=\"scroll\">" + drawing + "</div>";
}

}  // namespace plumb
