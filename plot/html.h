#pragma once

#include <string>
#include <vector>

// Reports as HTML: one page that loads nothing, of verdicts, tables and figures.
namespace plumb {

// The functions here share nothing: thread-safe.

/// The page's style sheet: light and dark.
extern const char kPageStyle[];
/// How each page of ours begins.
inline constexpr char kPageBegins[] =
    "<!DOCTYPE html>\n<html lang=\"en\">\n<head><meta charset=\"utf-8\"/>"
    "<meta name=\"generator\" content=\"Plumbline\"/>";
/// A whole page. @param title text. @param body HTML.
std::string Page(const std::string& title, const std::string& body);
/// A card. @param css "good", "bad" or empty. @param title, words text.
std::string Verdict(const std::string& css, const std::string& title, const std::string& words);

/// The key to drawings of prior and posterior. HTML, for the beginning of a caption.
inline constexpr char kPriorPosteriorKey[] =
    "<span class=\"key prior\"></span>prior (dashed) &#160; <span class=\"key "
    "posterior\"></span>posterior. ";

/// A value with as many digits as its standard deviation allows: two significant ones of that. Four
/// significant ones where the sd is not positive or not finite; a dash for NaN.
std::string Number(double value, double sd);
/// "9.81 +- 0.02", with the proper sign.
std::string PlusMinus(double value, double sd);

/// A table that scrolls where it is too wide. Cells and header are HTML.
class Table {
 public:
  explicit Table(const std::vector<std::string>& header);
  void Add(const std::vector<std::string>& cells);
  std::string Print() const;

 private:
  std::string rows_;
};

/// Text, which is escaped; nothing of nothing.
std::string Paragraph(const std::string& text);
/// Both HTML.
std::string Figure(const std::string& drawing, const std::string& caption);
/// For what would be illegible if it shrank to a phone's width. HTML.
std::string Scrolling(const std::string& drawing);

}  // namespace plumb
